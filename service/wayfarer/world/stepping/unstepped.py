"""Chunks that are planned without the engine: agents that rest, coast, or are held by a fault."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from wayfarer.spec import NEW_FRAMES
from wayfarer.world.agents.agent import ChunkFlag, Sight
from wayfarer.world.agents.faults import Faults, Stage
from wayfarer.world.agents.slots import Mode, Motion, SlotTable
from wayfarer.world.goals.steering import Steering, observe
from wayfarer.world.rows import Flags, Float, Index
from wayfarer.world.stepping.coasting import coast
from wayfarer.world.stepping.guards import got_up
from wayfarer.world.stepping.guide import NextTarget
from wayfarer.world.stepping.playback import Chunks, Playback


class Unstepped:
    """Plans such chunks for a world, and counts them."""

    def __init__(
        self,
        *,
        table: SlotTable,
        playback: Playback,
        steering: Steering,
        faults: Faults,
        due: Callable[[float], Index],
        next_step: Callable[[Index], tuple[Motion, NextTarget]],
        append: Callable[[Index, Chunks, int], None],
        reset: Callable[[int], Motion],
    ) -> None:
        """`due(frame)`: slots to be planned that no fault holds. `next_step`, `append` and `reset`
        are the scheduler's.
        """
        self._table = table
        self._playback = playback
        self._steering = steering
        self._faults = faults
        self._due = due
        self._next = next_step
        self._append = append
        self._reset = reset
        self.held_steps = 0  # rows held instead of stepped
        self.coasted_steps = 0  # rows that coasted instead of being stepped

    def hold(self, frame: float) -> int:
        """Plans the next chunk of all idle agents that are due by world frame `frame`.

        They repeat their last standing frame. The motion seed does not change, so they continue
        from it as if no time had passed. Returns how many were held.
        """
        rows = self._due(frame)
        rows = rows[self._table.rows.planned.gait.mode[rows] == Mode.STANDING]
        if self._faults.any:
            rows = rows[~self._faults.out(rows, Stage.RESTING)]
        return self._each(Stage.RESTING, rows, self._rest)

    def _rest(self, rows: Index) -> int:
        after, (_, goals) = self._next(rows)
        idle = np.flatnonzero((after.gait.mode == Mode.STANDING) & ~goals.more)
        rows, after, goals = rows[idle], after.take(idle), goals.take(idle)
        seed, start = after.seed, after.seed.translation[:, -1]
        translation = np.repeat(start[:, None], NEW_FRAMES, axis=1)
        rotations = np.repeat(seed.rotations[:, -1:], NEW_FRAMES, axis=1)
        contacts = np.ones((len(rows), NEW_FRAMES, 2), np.bool_)
        after.gait = observe(after.gait, start, translation, goals)
        self._plan(rows, translation, rotations, contacts, after, ChunkFlag.HELD)
        self.held_steps += len(rows)
        return len(rows)

    def coast(self, frame: float) -> int:
        """Plans the next chunk of all agents due by world frame `frame` that are seen at most as a
        root: without the engine, see coasting.py. Returns how many coasted.
        """
        rows = self._due(frame)
        rows = rows[self._table.rows.sight[rows] >= Sight.ROOT]
        return self._each(Stage.COASTING, rows, self._coast)

    def _coast(self, rows: Index) -> int:
        slots = self._table.rows
        start, (ahead, judged) = self._next(rows)
        seed, before = start.seed, start.gait
        targets = self._steering.targets(before, seed, ahead)
        translation, rotations, contacts, end = coast(
            seed, before, targets, ahead, slots.planned_chunks[rows]
        )
        gait = observe(before, seed.translation[:, -1], translation, judged)
        arrives = np.where(gait.arrived & ~before.arrived, ChunkFlag.ARRIVED, ChunkFlag.NONE)
        after = replace(start, seed=end, gait=gait)
        self._plan(rows, translation, rotations, contacts, after, ChunkFlag.REDUCED | arrives)
        slots.coasted[rows] = True
        self.coasted_steps += len(rows)
        return len(rows)

    def stand_aside(self, frame: float) -> None:
        """Plans the next chunk of all agents due by world frame `frame` that a fault holds: they
        come to a stand and stay there.
        """
        rows = self._playback.due(frame)
        for slot in rows[self._faults.held(rows)].tolist():
            try:
                self._stand(np.array([slot]))
            except Exception as error:
                self._faults.stop(slot, Stage.STANDING, error)

    def _stand(self, rows: Index) -> None:
        slots = self._table.rows
        after = slots.planned.take(rows)
        seed = after.seed
        if (after.gait.mode == Mode.STANDING).all():
            translation = np.repeat(seed.translation[:, -1:], NEW_FRAMES, axis=1)
            rotations = np.repeat(seed.rotations[:, -1:], NEW_FRAMES, axis=1)
        else:
            stand = Motion.join([self._reset(int(row)) for row in rows])
            translation, rotations = got_up(seed, stand)
            stand.gait.waypoint[:] = after.gait.waypoint
            after.seed, after.gait = stand.seed, stand.gait
        contacts = np.ones((len(rows), NEW_FRAMES, 2), np.bool_)
        self._plan(rows, translation, rotations, contacts, after, ChunkFlag.HELD)

    def _each(self, stage: Stage, rows: Index, run: Callable[[Index], int]) -> int:
        """The sum of the results of `run` for slots [A], all together or in parts."""
        if not len(rows):
            return 0
        self._faults.stage = stage
        try:
            return run(rows)
        except Exception as error:
            parts = self._faults.split(rows, lambda some: run(rows[some]), error)
            return sum(count for _, count in parts)

    def _plan(
        self,
        rows: Index,
        translation: Float,
        rotations: Float,
        contacts: Flags,
        end: Motion,
        flags: Any,
    ) -> None:
        """Puts frames into playback that the engine has not made."""
        slots = self._table.rows
        flags = flags | np.where(slots.replanned[rows], ChunkFlag.REPLANNED, ChunkFlag.NONE)
        chunks = Chunks(
            translation=translation,
            rotations=rotations,
            contacts=contacts,
            flags=flags.astype(np.uint8),
            goal_revision=slots.goal_revision[rows],
            candidates=np.zeros(len(rows), np.int16),
            end=end,
        )
        self._append(rows, chunks, 0)
