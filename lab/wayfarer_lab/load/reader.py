"""The reading side of a simulated client: lateness of primitives and goals, validity of poses."""

import math
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from wayfarer.spec import STEP_SECONDS
from wayfarer.v1 import agent_pb2, motion_pb2
from wayfarer_lab.load.tally import RingTally, Tally

STANDING = agent_pb2.AGENT_STATE_STANDING
FIRST, GAP = motion_pb2.CHUNK_FLAG_FIRST, motion_pb2.CHUNK_FLAG_GAP
REDUCED, HELD = motion_pb2.CHUNK_FLAG_REDUCED, motion_pb2.CHUNK_FLAG_HELD

LOST_S = STEP_SECONDS
"""A primitive that comes later than this is a miss: its last frame is over."""


@dataclass(slots=True)
class Latest:
    """The primitive of an agent that came last."""

    seq: int
    due: float  # its scheduled instant, Unix seconds
    ring: RingTally  # in which it came


class Reader:
    """Counts one session's stream. Times: Unix seconds, by the clock of the server.

    Primitives that are due in [since, until) count. An agent has one every 0.2 s from its first on.
    Primitives that a late server leaves out, drops, or takes off the schedule are misses too, as
    late as they are when that shows. They count in the ring in which the agent came last.

    With rings, nothing is due of an agent that is out of sight: until it is in `added`, and once it
    is in `hidden`.
    """

    def __init__(self, tally: Tally, since: float, until: float = math.inf) -> None:
        self._has_rings = bool(tally.rings)
        self.goals = GoalWatch(tally, self._has_rings)
        self._tally = tally
        self._since, self._until = since, until
        self._latest: dict[int, Latest] = {}  # by alias
        self._shown: set[int] = set()  # aliases introduced on this stream, and not taken away
        self._check = PoseCheck()

    def take(self, message: motion_pb2.StreamMotionResponse, now: float) -> None:
        """Counts a message that came at `now`."""
        if message.HasField("header"):
            self._begin(message.header, now)
        batch = message.batch
        chunks, ring = batch.chunks, self._tally.by_ring[batch.tier]
        if self._since <= now < self._until:
            described = sum(agent.ByteSize() for agent in batch.added)
            self._tally.described += described
            ring.bytes += message.ByteSize() - described
        self._hide((*batch.hidden, *batch.removed), now)
        added = {agent.alias for agent in batch.added}
        columns = zip(
            *(chunks.aliases, chunks.seqs, chunks.scheduled_at_us),
            *(chunks.goal_revisions, chunks.states, chunks.flags),
            strict=True,
        )
        due_at: dict[float, int] = {}
        for row, (alias, seq, at, revision, state, flags) in enumerate(columns):
            due = 1e-6 * at
            self._tally.popped += self._pops(alias, seq, flags, alias in added)
            self._follow(alias, Latest(seq, due, ring), now)
            self.goals.seen(alias, revision, now)
            if self._since <= due < self._until:
                due_at[due] = due_at.get(due, 0) + 1
                if flags:
                    ring.reduced += bool(flags & REDUCED)
                    ring.held += bool(flags & HELD)
                self._tally.idle += state == STANDING
                self._tally.malformed += not self._check.passes(chunks, row, batch.tier)
        for due, count in due_at.items():
            self._count(ring, due, now - due, count)

    def _begin(self, header: motion_pb2.StreamHeader, now: float) -> None:
        """A stream has begun, which introduces everybody again."""
        self._check = PoseCheck(header)
        self._shown.clear()
        if self._has_rings:  # of those shown before, it brings who is in sight
            self._hide(list(self._latest), now)

    def _hide(self, aliases: Iterable[int], now: float) -> None:
        """Handles agents that went out of sight: only primitives due by `now` can be lost."""
        for alias in aliases:
            self._shown.discard(alias)
            self.goals.hide(alias)
            if latest := self._latest.pop(alias, None):
                self._lose(latest, math.floor((now - latest.due) / STEP_SECONDS) - 1, now)

    def _pops(self, alias: int, seq: int, flags: int, is_added: bool) -> bool:
        """Somebody appears, or jumps, of whom the stream has not said so."""
        if alias not in self._shown:
            self._shown.add(alias)
            return not (is_added and flags & FIRST)
        return seq > self._latest[alias].seq + 1 and not flags & (FIRST | GAP)

    def _follow(self, alias: int, new: Latest, now: float) -> None:
        if latest := self._latest.get(alias):
            self._tally.repeated += new.seq <= latest.seq
            if lost := round((new.due - latest.due) / STEP_SECONDS) - 1:
                self._lose(latest, lost, now)
        self._latest[alias] = new

    def _count(self, ring: RingTally, due: float, late: float, count: int) -> None:
        ring.chunks += count
        ring.lateness.add(late, count)
        ring.late += count * (late > LOST_S)
        ring.over_time.add(due - self._since, late, late > LOST_S, count)

    def _lose(self, latest: Latest, count: int, now: float) -> None:
        """Number of primitives after the latest that have not come by `now`."""
        for number in range(1, count + 1):
            due = latest.due + number * STEP_SECONDS
            if self._since <= due < self._until:
                latest.ring.lost += 1
                latest.ring.lateness.add(now - due)
                latest.ring.over_time.add(due - self._since, now - due, True)

    def finish(self, agents: int, now: float) -> None:
        """Nothing more is read: what `agents` agents have not sent in time by `now` is lost."""
        last = min(now - LOST_S, self._until)
        for latest in self._latest.values():
            self._lose(latest, math.ceil((last - latest.due) / STEP_SECONDS) - 1, now)
        silent = 0 if self._has_rings else max(agents - len(self._latest), 0)
        self._tally.silent += silent
        for _ in range(silent):  # unknown schedule: as if it began with the measurement
            begun = Latest(-1, self._since - STEP_SECONDS, self._tally.by_ring[0])
            self._lose(begun, math.ceil((last - begun.due) / STEP_SECONDS) - 1, now)
        self.goals.finish(now)


EVERY = 64
"""One chunk in this number is unpacked."""

TRANSLATION_FLOATS = 3
TRANSLATION_BYTES = 4 * TRANSLATION_FLOATS
ROTATION_FLOATS = 4
NORM_TOLERANCE = 1e-3

F32 = motion_pb2.POSE_ENCODING_F32_LE


class PoseCheck:
    """Checks chunks of one stream: their length, where people are, and rotations in float32."""

    def __init__(self, header: motion_pb2.StreamHeader | None = None) -> None:
        """`header` has the layout of each ring; without a header no chunk is valid."""
        self._layouts = [
            (each.frame_bytes, each.pose_encoding == F32)
            for each in (header.tiers or [header] if header else [])
        ]
        self._seen = 0

    def passes(self, chunks: motion_pb2.MotionChunks, row: int, tier: int) -> bool:
        """False if this chunk is in the sample and is not finite or has no unit quaternions."""
        self._seen += 1
        return self._seen % EVERY != 1 or self._is_motion(chunks, row, tier)

    def _is_motion(self, chunks: motion_pb2.MotionChunks, row: int, tier: int) -> bool:
        if tier >= len(self._layouts):
            return False
        frames, (size, has_floats) = len(chunks.contacts), self._layouts[tier]
        if not frames or frames % len(chunks.aliases) or len(chunks.poses) != size * frames:
            return False
        own = frames // len(chunks.aliases)
        packed = np.frombuffer(chunks.poses, np.uint8, own * size, row * own * size)
        known = packed.reshape(own, size)[:, : size if has_floats else TRANSLATION_BYTES]
        values = np.ascontiguousarray(known).view("<f4")
        rotations = values[:, TRANSLATION_FLOATS:].reshape(own, -1, ROTATION_FLOATS)
        off_unit = np.abs(np.linalg.norm(rotations, axis=-1) - 1)
        return bool(np.isfinite(values).all() and (off_unit < NORM_TOLERANCE).all())


UNANSWERED_S = 1.0
"""A goal older than this without a pose at the end counts as unanswered."""


class GoalWatch:
    """The goals of one session's agents. Times: Unix seconds."""

    def __init__(self, tally: Tally, has_rings: bool = False) -> None:
        """`has_rings`: goals of agents out of sight do not count."""
        self._tally = tally
        self._has_rings = has_rings
        self._sent_goals: defaultdict[int, dict[int, float]] = defaultdict(
            dict
        )  # alias: revision: when
        self._shown: dict[int, tuple[int, float]] = {}  # alias: newest revision, first seen when

    def asked(self, alias: int, revision: int, since: float) -> None:
        """Notes that a goal that was due at `since` has been answered with its revision."""
        if self._has_rings and alias not in self._shown:
            return
        shown, when = self._shown.get(alias, (-1, 0.0))
        if shown >= revision:  # its first chunk was quicker than the answer
            self._tally.goal_latency.add(when - since)
        else:
            self._sent_goals[alias][revision] = since

    def seen(self, alias: int, revision: int, now: float) -> None:
        """A pose planned for this revision has come. A newer goal answers for those it replaced."""
        if self._shown.get(alias, (-1, 0.0))[0] >= revision:
            return
        self._shown[alias] = (revision, now)
        waiting = self._sent_goals[alias]
        for known in [r for r in waiting if r <= revision]:
            self._tally.goal_latency.add(now - waiting.pop(known))

    def hide(self, alias: int) -> None:
        """The agent is out of sight from now on."""
        self._shown.pop(alias, None)
        self._sent_goals.pop(alias, None)

    def finish(self, now: float) -> None:
        """Counts the goals without a pose, as late as they are by now."""
        for waiting in self._sent_goals.values():
            for since in waiting.values():
                if now - since > UNANSWERED_S:
                    self._tally.unanswered += 1
                    self._tally.goal_latency.add(now - since)
