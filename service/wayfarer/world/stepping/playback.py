"""Frames that are planned and not yet sent: a ring of chunks per slot.

Frames count from the world's epoch at 40 per second. Chunk `n` of a slot shows frames `start_frame
+ 8 n …`, is planned `lead` chunks ahead of that, and leaves when it is due. Each chunk carries the
motion at its end, so that a replan can return to any chunk boundary.
"""

from dataclasses import dataclass
from functools import cache
from typing import Annotated, Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.spec import NEW_FRAMES, POSED_JOINTS
from wayfarer.world.agents.agent import Sight
from wayfarer.world.agents.slots import Motion, Slots
from wayfarer.world.rows import Double, Flags, Float, Index, Int, Int8, Int16, Rows, Shape, UInt8

ROUNDING: Final = 1e-3
"""Share of a primitive: chunks due this shortly after a moment count as due at that moment."""

FOREVER: Final = int(np.iinfo(np.int64).max)

REPLAN_FRAMES: Final = NEW_FRAMES // 2
"""Frames ahead of its time at which a replanned chunk is planned: the moment at which the other
phase is planned, so that both share an engine call. Planning earlier would not show it sooner, and
goals that come one by one would each have a separate engine call.
"""


@dataclass(slots=True)
class Chunks(Rows):
    """Columns of planned chunks."""

    translation: Annotated[Float, Shape(NEW_FRAMES, 3)]
    rotations: Annotated[Float, Shape(NEW_FRAMES, POSED_JOINTS, 4)]
    contacts: Annotated[Flags, Shape(NEW_FRAMES, 2)]
    flags: UInt8  # ChunkFlag
    goal_revision: Int
    candidates: Int16
    end: Motion


@dataclass(frozen=True, slots=True)
class Sent:
    """Chunks that have just left; one row each, by session and in order of their first frame."""

    slots: Index
    seq: Index
    frame: Index  # world frame of the first frame
    chunks: Chunks

    def take(self, which: Index) -> "Sent":
        """A copy of some of its rows."""
        return Sent(self.slots[which], self.seq[which], self.frame[which], self.chunks.take(which))


class Times(NamedTuple):
    """When the chunks of all slots are planned and sent."""

    active: Flags
    frozen: Flags
    engine_call: Int
    start: Int
    planned: Int
    sent: Int
    replanned: Flags
    depth: int  # of a ring
    ahead: int  # frames that a chunk is planned ahead of its time
    replan: int  # the same for a chunk that replaces another


class Playback:
    """The rings of all slots of a table."""

    def __init__(self, slots: Slots, lead: int) -> None:
        """`lead`: number of chunks that are planned ahead of their time, at least 1."""
        self.lead = lead
        self._slots = slots
        # One more than the lead: the next may be planned at the moment when the first is due.
        self._depth = lead + 1
        self._ring = Chunks.empty(len(slots.active) * self._depth)

    def due(self, frame: float) -> Index:
        """Slots whose next chunk must be planned by world frame `frame`, first shown first."""
        rows, shown = find_due(self._times, float(frame))
        return rows[np.argsort(shown, kind="stable")]

    def is_due(self, rows: Index, frame: float) -> Flags:
        """Whether slots [A], all of which may be planned, need their next chunk by `frame`."""
        due: Flags = self._plan_frame(rows) <= frame
        return due

    def waited(self, rows: Index, frame: float) -> Double:
        """Frames since the next chunks of slots [A] could first be planned; for replanned slots, as
        early as for the others.
        """
        frames: Double = np.float64(frame) - (self._next_shown(rows) - NEW_FRAMES * self.lead)
        return frames

    def next_event(self, planning: bool = True, early: float = 0.0) -> float | None:
        """World frame of the next sending or, with `planning`, planning; None without any.

        Chunks are sent `early` frames early.
        """
        frame = find_next(self._times, planning, float(early))
        return frame if frame < np.inf else None

    def slack(self, frame: float) -> float:
        """Frames from world frame `frame` until the display of the next chunk to be planned.

        New and just replanned agents are ignored, since they are always due at once.
        """
        return float(find_first(self._times) - frame)

    def append(self, rows: Index, chunks: Chunks) -> None:
        """Adds the next planned chunk of each row."""
        slots = self._slots
        self._reserve()
        self._ring.put(self._place(rows, slots.planned_chunks[rows]), chunks)
        slots.planned.put(rows, chunks.end)
        slots.planned_chunks[rows] += 1

    def send(self, frame: float, only: Index | None = None) -> list[Sent]:
        """Takes out the chunks that should be shown by world frame `frame`, oldest first.

        Takes those of all slots, or only of some.
        """
        slots = self._slots
        sent: list[Sent] = []
        while True:
            rows, show = find_leaving(self._times, float(frame))
            if only is not None:
                mine = np.isin(rows, only)
                rows, show = rows[mine], show[mine]
            if not len(rows):
                return sent
            order = np.lexsort((show, slots.session[rows]))
            rows, show = rows[order], show[order]
            seq = slots.sent_chunks[rows]
            chunks = self._ring.take(self._place(rows, seq))
            slots.committed.put(rows, chunks.end)
            slots.sent_chunks[rows] += 1
            sent.append(Sent(rows, seq, show, chunks))

    def replan(self, slot: int, keep_until: float) -> None:
        """Discards planned chunks of a slot that are shown after world frame `keep_until`, and the
        one that is being made.
        """
        slots = self._slots
        slots.engine_call[slot] = 0
        row = np.array([slot])
        first, planned = int(slots.sent_chunks[slot]), int(slots.planned_chunks[slot])
        kept = first
        while kept < planned and self._show_frame(row, np.array([kept]))[0] <= keep_until:
            kept += 1
        if kept == planned:
            return
        slots.replanned[slot] = True
        slots.planned_chunks[slot] = kept
        end = (
            slots.committed.take(row)
            if kept == first
            else self._ring.end.take(self._place(row, np.array([kept - 1])))
        )
        slots.planned.put(row, end)

    def hold(self, rows: Index, until: float) -> None:
        """Shows nothing of some slots before world frame `until`; nothing is lost.

        They wait for whole primitives, so that they stay in their phase.
        """
        behind = (until - self._send_frame(rows)) / NEW_FRAMES
        short = np.ceil(behind - ROUNDING).astype(np.int64)
        self._slots.start_frame[rows] += NEW_FRAMES * np.maximum(short, 0)

    def skip(self, frame: float) -> Index:
        """Leaves out the primitives that are over by world frame `frame`; returns their numbers by
        `Sight`.

        A slot whose next chunk has not left by then continues with that chunk at the first of its
        moments that is not over: later by whole primitives, so that it stays in its phase, and
        without a jump.
        """
        over = np.zeros(len(Sight), np.int64)
        leave_out(self._times, self._slots.sight, float(frame), over)
        return over

    @property
    def _times(self) -> Times:
        slots, ahead = self._slots, NEW_FRAMES * self.lead
        return Times(
            slots.active,
            slots.frozen,
            slots.engine_call,
            slots.start_frame,
            slots.planned_chunks,
            slots.sent_chunks,
            slots.replanned,
            self._depth,
            ahead,
            min(REPLAN_FRAMES, ahead),
        )

    def _plan_frame(self, rows: Index) -> Index:
        slots, ahead = self._slots, NEW_FRAMES * self.lead
        early = np.where(slots.replanned[rows], min(REPLAN_FRAMES, ahead), ahead)
        return self._next_shown(rows) - early

    def _next_shown(self, rows: Index) -> Index:
        """The world frame at which the next chunk to be planned will be shown."""
        return self._show_frame(rows, self._slots.planned_chunks[rows])

    def _send_frame(self, rows: Index) -> Index:
        return self._show_frame(rows, self._slots.sent_chunks[rows])

    def _show_frame(self, rows: Index, seq: Index) -> Index:
        return self._slots.start_frame[rows] + NEW_FRAMES * seq

    def _place(self, rows: Index, seq: Index) -> Index:
        return rows * self._depth + seq % self._depth

    def _reserve(self) -> None:
        rows = len(self._slots.active) * self._depth
        if rows > len(self._ring.flags):
            self._ring.grow(rows)


@inner
def _plans(times: Times, slot: int) -> bool:
    """Whether a slot's next chunk may be planned and is not being made."""
    return times.active[slot] and times.engine_call[slot] == 0 and not times.frozen[slot]


@inner
def _plan_frame(times: Times, slot: int) -> int:
    early = times.replan if times.replanned[slot] else times.ahead
    return times.start[slot] + NEW_FRAMES * times.planned[slot] - early


@compiled
def find_due(times: Times, frame: float) -> tuple[Index, Index]:
    """Slots to be planned by `frame`, and the frames at which the planned chunks are shown."""
    found, shown = np.empty(len(times.active), np.int64), np.empty(len(times.active), np.int64)
    count = 0
    for slot in range(len(times.active)):
        has_room = times.planned[slot] - times.sent[slot] < times.depth
        if has_room and _plans(times, slot) and _plan_frame(times, slot) <= frame:
            found[count] = slot
            shown[count] = times.start[slot] + NEW_FRAMES * times.planned[slot]
            count += 1
    return found[:count], shown[:count]


@compiled
def find_leaving(times: Times, frame: float) -> tuple[Index, Index]:
    """Slots whose next chunk should be shown by `frame`, and its frame."""
    found, shown = np.empty(len(times.active), np.int64), np.empty(len(times.active), np.int64)
    count = 0
    for slot in range(len(times.active)):
        at = times.start[slot] + NEW_FRAMES * times.sent[slot]
        if times.active[slot] and times.planned[slot] > times.sent[slot] and at <= frame:
            found[count], shown[count] = slot, at
            count += 1
    return found[:count], shown[:count]


@compiled
def find_next(times: Times, planning: bool, early: float) -> float:
    """Implements `Playback.next_event`; inf without any."""
    first = np.inf
    for slot in range(len(times.active)):
        if times.active[slot] and times.planned[slot] > times.sent[slot]:
            first = min(first, times.start[slot] + NEW_FRAMES * times.sent[slot] - early)
        if planning and _plans(times, slot):
            first = min(first, float(_plan_frame(times, slot)))
    return first


@compiled
def find_first(times: Times) -> int:
    """Implements `Playback.slack`: the frame."""
    first = FOREVER
    for slot in range(len(times.active)):
        if _plans(times, slot) and not times.replanned[slot] and times.planned[slot] > 0:
            first = min(first, times.start[slot] + NEW_FRAMES * times.planned[slot])
    return first


@compiled
def leave_out(times: Times, sight: Int8, frame: float, over: Index) -> None:
    """Implements `Playback.skip`; adds the numbers by `sight` to `over`."""
    for slot in range(len(times.active)):
        if times.active[slot] and not times.frozen[slot]:
            late = frame - (times.start[slot] + NEW_FRAMES * times.sent[slot])
            if late >= NEW_FRAMES:
                count = int(late // NEW_FRAMES)
                times.start[slot] += NEW_FRAMES * count
                over[sight[slot]] += count


@cache
def prepare() -> None:
    """Compiles the rules, or loads them, before agents walk."""
    slots = Slots.empty(1)
    times, over = Playback(slots, 1)._times, np.zeros(len(Sight), np.int64)
    warm(find_due, times, 0.0)
    warm(find_leaving, times, 0.0)
    warm(find_next, times, True, 0.0)
    warm(find_first, times)
    warm(leave_out, times, slots.sight, 0.0, over)
