"""The reading side of a simulated client: counts chunks, and when goals show."""

from dataclasses import dataclass, field

from wayfarer.load.tally import Tally
from wayfarer.spec import STEP_SECONDS
from wayfarer.v1 import motion_pb2

LOST_S = STEP_SECONDS
"""A primitive that comes later than this has nothing left to show: a miss."""


@dataclass
class Reader:
    """What one stream has told so far. Times: Unix seconds, by the clock of the server."""

    tally: Tally
    measuring_from: float
    _next_seq: dict[int, int] = field(default_factory=dict)  # by alias
    _shown: dict[int, tuple[int, float]] = field(default_factory=dict)  # newest revision, since
    _asked: dict[tuple[int, int], float] = field(default_factory=dict)  # (alias, revision): when

    def take(self, message: motion_pb2.StreamMotionResponse, now: float) -> None:
        """Count a message that came at `now`."""
        measured = now >= self.measuring_from
        if measured:
            self.tally.bytes += message.ByteSize()
        for chunk in message.batch.chunks:
            alias, seq, revision = chunk.alias, chunk.seq, chunk.goal_revision
            if self._shown.get(alias, (-1, 0.0))[0] < revision:
                self._shown[alias] = (revision, now)
                self._goal_shows(alias, revision, now)
            missing = seq - self._next_seq.get(alias, seq)
            self._next_seq[alias] = seq + 1
            if measured:
                late = now - 1e-6 * chunk.scheduled_at_us
                self.tally.lateness.add(late)
                self.tally.chunks += 1
                self.tally.misses += max(missing, 0) + (late > LOST_S)
                self.tally.reduced += bool(chunk.flags & motion_pb2.CHUNK_FLAG_REDUCED)
                self.tally.held += bool(chunk.flags & motion_pb2.CHUNK_FLAG_HELD)

    def asked(self, alias: int, revision: int, since: float) -> None:
        """A goal command sent at `since` has been answered with its revision."""
        shown, when = self._shown.get(alias, (-1, 0.0))
        if shown >= revision:  # its first chunk was quicker than the answer
            self.tally.goal_latency.add(when - since)
        else:
            self._asked[alias, revision] = since

    def _goal_shows(self, alias: int, revision: int, now: float) -> None:
        for key in [k for k in self._asked if k[0] == alias and k[1] <= revision]:
            self.tally.goal_latency.add(now - self._asked.pop(key))
