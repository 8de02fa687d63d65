"""The reading side of a simulated client: lateness of primitives and goals, validity of poses."""

import math
from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from wayfarer.spec import STEP_SECONDS
from wayfarer.v1 import agent_pb2, motion_pb2
from wayfarer_lab.load.tally import Tally

STANDING = agent_pb2.AGENT_STATE_STANDING
REDUCED, HELD = motion_pb2.CHUNK_FLAG_REDUCED, motion_pb2.CHUNK_FLAG_HELD

LOST_S = STEP_SECONDS
"""A primitive that comes later than this is a miss: its last frame is over."""


@dataclass(slots=True)
class Latest:
    """The primitive of an agent that came last."""

    seq: int
    due: float  # its scheduled instant, Unix seconds


class Reader:
    """Counts one session's stream. Times: Unix seconds, by the clock of the server.

    What counts are the primitives that fall due in [since, until). An agent has one every 0.2 s
    from its first on: those that are left out, dropped, or taken off its schedule by a server that
    has fallen behind are misses all the same, and as late as they are when that shows.
    """

    def __init__(
        self, tally: Tally, since: float, until: float = math.inf, has_rings: bool = False
    ) -> None:
        """`has_rings`: agents beyond the last ring are not sent, so nothing is due of them."""
        self.goals = GoalWatch(tally, has_rings)
        self._has_rings = has_rings
        self._tally = tally
        self._since, self._until = since, until
        self._latest: dict[int, Latest] = {}  # by alias
        self._check = PoseCheck()

    def take(self, message: motion_pb2.StreamMotionResponse, now: float) -> None:
        """Count a message that came at `now`."""
        if message.HasField("header"):
            self._check = PoseCheck(message.header)
        chunks, tier = message.batch.chunks, message.batch.tier
        if self._since <= now < self._until:
            self._tally.sent(tier, len(chunks.aliases), message.ByteSize())
        for alias in message.batch.hidden:
            self._latest.pop(alias, None)
            self.goals.hide(alias)
        columns = zip(
            *(chunks.aliases, chunks.seqs, chunks.scheduled_at_us),
            *(chunks.goal_revisions, chunks.states, chunks.flags),
            strict=True,
        )
        for row, (alias, seq, at, revision, state, flags) in enumerate(columns):
            due = 1e-6 * at
            self._follow(alias, seq, due, now)
            self.goals.seen(alias, revision, now)
            if self._since <= due < self._until:
                self._count(now - due, state, flags)
                self._tally.over_time.add(due - self._since, now - due, now - due > LOST_S)
                # poses beyond the first ring are packed in other ways
                self._tally.malformed += tier == 0 and not self._check.passes(chunks, row)

    def _follow(self, alias: int, seq: int, due: float, now: float) -> None:
        latest = self._latest.get(alias)
        if latest is None:
            self._latest[alias] = Latest(seq, due)
            return
        self._tally.repeated += seq <= latest.seq
        self._lose(latest, round((due - latest.due) / STEP_SECONDS) - 1, now)
        latest.seq, latest.due = seq, due

    def _count(self, late: float, state: int, flags: int) -> None:
        tally = self._tally
        tally.chunks += 1
        tally.lateness.add(late)
        tally.late += late > LOST_S
        tally.idle += state == STANDING
        if flags:
            tally.reduced += bool(flags & REDUCED)
            tally.held += bool(flags & HELD)

    def _lose(self, latest: Latest, count: int, now: float) -> None:
        """Number of primitives after the latest that have not come by `now`."""
        for number in range(1, count + 1):
            due = latest.due + number * STEP_SECONDS
            if self._since <= due < self._until:
                self._tally.lost += 1
                self._tally.lateness.add(now - due)
                self._tally.over_time.add(due - self._since, now - due, True)

    def finish(self, agents: int, now: float) -> None:
        """Nothing more is read: what `agents` agents have not sent in time by `now` is lost."""
        last = min(now - LOST_S, self._until)
        for latest in self._latest.values():
            self._lose(latest, math.ceil((last - latest.due) / STEP_SECONDS) - 1, now)
        silent = 0 if self._has_rings else max(agents - len(self._latest), 0)
        self._tally.silent += silent
        for _ in range(silent):  # unknown schedule: as if it began with the measurement
            begun = Latest(-1, self._since - STEP_SECONDS)
            self._lose(begun, math.ceil((last - begun.due) / STEP_SECONDS) - 1, now)
        self.goals.finish(now)


EVERY = 64
"""One chunk in this number is unpacked."""

TRANSLATION_FLOATS = 3
ROTATION_FLOATS = 4
NORM_TOLERANCE = 1e-3


class PoseCheck:
    """Checks chunks of one stream in float32, the default encoding."""

    def __init__(self, header: motion_pb2.StreamHeader | None = None) -> None:
        """`header` has the layout; without a header no chunk is valid."""
        bones = 0 if header is None else len(header.bones)
        self._frame_floats = TRANSLATION_FLOATS + ROTATION_FLOATS * bones if bones else 0
        self._seen = 0

    def passes(self, chunks: motion_pb2.MotionChunks, row: int) -> bool:
        """False if this chunk is in the sample and is not finite or has no unit quaternions."""
        self._seen += 1
        return self._seen % EVERY != 1 or self._is_motion(chunks, row)

    def _is_motion(self, chunks: motion_pb2.MotionChunks, row: int) -> bool:
        frames, size = len(chunks.contacts), 4 * self._frame_floats
        if not frames or frames % len(chunks.aliases) or len(chunks.poses) != size * frames:
            return False
        own = frames // len(chunks.aliases)
        values = np.frombuffer(chunks.poses, "<f4", own * self._frame_floats, row * own * size)
        values = values.reshape(own, self._frame_floats)
        rotations = values[:, TRANSLATION_FLOATS:].reshape(own, -1, ROTATION_FLOATS)
        off_unit = np.abs(np.linalg.norm(rotations, axis=-1) - 1)
        return bool(np.isfinite(values).all() and (off_unit < NORM_TOLERANCE).all())


UNANSWERED_S = 1.0
"""A goal older than this without a pose at the end counts as unanswered."""


class GoalWatch:
    """The goals of one session's agents. Times: Unix seconds."""

    def __init__(self, tally: Tally, has_rings: bool = False) -> None:
        """`has_rings`: what is asked of agents out of sight does not count."""
        self._tally = tally
        self._has_rings = has_rings
        self._asked: defaultdict[int, dict[int, float]] = defaultdict(dict)  # alias: revision: when
        self._shown: dict[int, tuple[int, float]] = {}  # alias: newest revision, first seen when

    def asked(self, alias: int, revision: int, since: float) -> None:
        """A goal that was to be given at `since` has been answered with its revision."""
        if self._has_rings and alias not in self._shown:
            return
        shown, when = self._shown.get(alias, (-1, 0.0))
        if shown >= revision:  # its first chunk was quicker than the answer
            self._tally.goal_latency.add(when - since)
        else:
            self._asked[alias][revision] = since

    def seen(self, alias: int, revision: int, now: float) -> None:
        """A pose planned for this revision has come. A newer goal answers for those it replaced."""
        if self._shown.get(alias, (-1, 0.0))[0] >= revision:
            return
        self._shown[alias] = (revision, now)
        waiting = self._asked[alias]
        for known in [r for r in waiting if r <= revision]:
            self._tally.goal_latency.add(now - waiting.pop(known))

    def hide(self, alias: int) -> None:
        """The agent is out of sight from now on."""
        self._shown.pop(alias, None)
        self._asked.pop(alias, None)

    def finish(self, now: float) -> None:
        """Count the goals without a pose, as late as they are by now."""
        for waiting in self._asked.values():
            for since in waiting.values():
                if now - since > UNANSWERED_S:
                    self._tally.unanswered += 1
                    self._tally.goal_latency.add(now - since)
