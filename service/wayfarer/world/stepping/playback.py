"""Frames that are planned and not yet sent: a ring of chunks per slot.

Frames count from the world's epoch at 40 per second. Chunk `n` of a slot shows frames
`start_frame + 8 n …`, is planned `lead` chunks ahead of that, and leaves when it falls due. Each
chunk carries the motion at its end, so that a replan can go back to any chunk boundary.
"""

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from wayfarer.spec import NEW_FRAMES, POSED_JOINTS
from wayfarer.world.agents.agent import Sight
from wayfarer.world.agents.slots import Motion, Slots
from wayfarer.world.rows import Double, Flags, Float, Index, Int, Int16, Rows, Shape, UInt8

ROUNDING: Final = 1e-3
"""Share of a primitive: what is due this shortly before a moment is due at that moment."""

REPLAN_FRAMES: Final = 5
"""A replanned chunk is planned this many frames ahead of its time: it may have to wait for two
engine calls that are under way. Earlier planning would not be seen sooner, and goals that come one
by one would each have an engine call of their own."""


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
    """Chunks that have just left; one row each, in order of their first frame."""

    slots: Index
    seq: Index
    frame: Index  # world frame of the first frame
    chunks: Chunks

    def take(self, which: Index) -> "Sent":
        """A copy of some of its rows."""
        return Sent(self.slots[which], self.seq[which], self.frame[which], self.chunks.take(which))


class Playback:
    """The rings of all slots of a table."""

    def __init__(self, slots: Slots, lead: int) -> None:
        """`lead` is how many chunks ahead of their time they are planned, at least 1."""
        self.lead = lead
        self._slots = slots
        # One more than the lead: the next may be planned at the moment the first falls due.
        self._depth = lead + 1
        self._ring = Chunks.empty(len(slots.active) * self._depth)

    def due(self, frame: float) -> Index:
        """Slots whose next chunk is to be planned by world frame `frame`, those first for which it
        is to be shown first.
        """
        slots = self._slots
        rows = np.flatnonzero(
            self._plannable & (slots.planned_chunks - slots.sent_chunks < self._depth)
        )
        rows = rows[self._plan_frame(rows) <= frame]
        return rows[np.argsort(self._next_shown(rows), kind="stable")]

    def is_due(self, rows: Index, frame: float) -> Flags:
        """Which slots [A], all of which may be planned, need their next chunk by `frame`."""
        due: Flags = self._plan_frame(rows) <= frame
        return due

    def waited(self, rows: Index, frame: float) -> Double:
        """Frames since the next chunks of slots [A] could first be planned; who is replanned could
        be so as early as the others.
        """
        frames: Double = np.float64(frame) - (self._next_shown(rows) - NEW_FRAMES * self.lead)
        return frames

    def next_event(self, planning: bool = True, early: float = 0.0) -> float | None:
        """World frame of the next sending or, unless not asked for, planning; None without any.

        Chunks are sent `early` frames early.
        """
        slots = self._slots
        waits = slots.active & (slots.planned_chunks > slots.sent_chunks)
        events = self._send_frame(np.flatnonzero(waits)) - early
        if planning:
            plans = self._plan_frame(np.flatnonzero(self._plannable))
            events = np.concatenate([events, plans])
        return float(events.min()) if len(events) else None

    def slack(self, frame: float) -> float:
        """Frames from world frame `frame` until the next chunk to be planned is to be shown.

        Agents that are new or were just replanned are ignored: they are always due at once.
        """
        slots = self._slots
        rows = np.flatnonzero(self._plannable & ~slots.replanned & (slots.planned_chunks > 0))
        return float(self._next_shown(rows).min(initial=np.iinfo(np.int64).max) - frame)

    def append(self, rows: Index, chunks: Chunks) -> None:
        """Add the next planned chunk of each row."""
        slots = self._slots
        self._reserve()
        self._ring.put(self._place(rows, slots.planned_chunks[rows]), chunks)
        slots.planned.put(rows, chunks.end)
        slots.planned_chunks[rows] += 1

    def send(self, frame: float, only: Index | None = None) -> list[Sent]:
        """Take out the chunks that are to be shown by world frame `frame`, oldest first.

        Of all slots, or of some.
        """
        slots = self._slots
        sent: list[Sent] = []
        while True:
            rows = np.flatnonzero(slots.active & (slots.planned_chunks > slots.sent_chunks))
            if only is not None:
                rows = rows[np.isin(rows, only)]
            seq = slots.sent_chunks[rows]
            show = self._show_frame(rows, seq)
            order = np.argsort(show, kind="stable")
            order = order[show[order] <= frame]
            if not len(order):
                return sent
            rows, seq, show = rows[order], seq[order], show[order]
            chunks = self._ring.take(self._place(rows, seq))
            slots.committed.put(rows, chunks.end)
            slots.sent_chunks[rows] += 1
            sent.append(Sent(rows, seq, show, chunks))

    def replan(self, slot: int, keep_until: float) -> None:
        """Throw away planned chunks of a slot that are shown after world frame `keep_until`.

        And the one that is being made.
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
        """Let nothing of some slots be shown before world frame `until`; nothing is lost.

        They wait for whole primitives, so that they stay in their phase.
        """
        behind = (until - self._send_frame(rows)) / NEW_FRAMES
        short = np.ceil(behind - ROUNDING).astype(np.int64)
        self._slots.start_frame[rows] += NEW_FRAMES * np.maximum(short, 0)

    def skip(self, frame: float) -> Index:
        """Leave out the primitives that are over by world frame `frame`; returns how many, of
        agents seen so well (by `Sight`).

        A slot whose next chunk has not left by then goes on with that chunk at the first of its
        moments that is not over: later by whole primitives, so that it stays in its phase, and
        without a jump.
        """
        slots = self._slots
        rows = np.flatnonzero(slots.active & ~slots.frozen)
        late = frame - self._send_frame(rows)
        over = np.maximum(late // NEW_FRAMES, 0).astype(np.int64)
        slots.start_frame[rows] += NEW_FRAMES * over
        return np.bincount(np.repeat(slots.sight[rows], over), minlength=len(Sight))

    @property
    def _plannable(self) -> Flags:
        """Slots whose next chunk is not being made, and may be."""
        slots = self._slots
        plannable: Flags = slots.active & (slots.engine_call == 0) & ~slots.frozen
        return plannable

    def _plan_frame(self, rows: Index) -> Index:
        slots, ahead = self._slots, NEW_FRAMES * self.lead
        early = np.where(slots.replanned[rows], min(REPLAN_FRAMES, ahead), ahead)
        return self._next_shown(rows) - early

    def _next_shown(self, rows: Index) -> Index:
        """The world frame at which the next chunk to be planned is to be shown."""
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
