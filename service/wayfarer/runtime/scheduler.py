"""Who is stepped when: the scheduler sees slots and frames, never what the tensors mean."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wayfarer.runtime.agent import ChunkFlag
from wayfarer.runtime.batch import broken, cut, gather, pad
from wayfarer.runtime.engine import Engine, StepInputs, StepOutputs
from wayfarer.runtime.paths import Paths
from wayfarer.runtime.playback import Chunks, Playback
from wayfarer.runtime.rows import Index
from wayfarer.runtime.slots import Flags, Gait, Goals, Motion, Seeds, SlotTable
from wayfarer.runtime.steering import Steering, observe
from wayfarer.spec import GENDERS, SEED_FRAMES


@dataclass(frozen=True, slots=True)
class Batch:
    """Agents of one gender that are stepped together."""

    rows: Index
    gender: str
    seed: Seeds
    gait: Gait  # of the step to come
    goals: Goals
    inputs: StepInputs
    candidates: int
    reduced: Flags  # rows for which steering wished for more candidates


class Scheduler:
    """Steps due agents, one engine call a tick."""

    def __init__(
        self,
        table: SlotTable,
        playback: Playback,
        paths: Paths,
        engine: Engine,
        steering: Steering,
        reset: Callable[[int], Motion],
        batch_sizes: tuple[int, ...],
    ) -> None:
        """`reset(slot)` gives the standing motion from which a broken agent goes on."""
        self._table = table
        self._playback = playback
        self._paths = paths
        self._engine = engine
        self._steering = steering
        self._reset = reset
        self._sizes = batch_sizes
        self.resets = 0  # broken rows so far
        self.reduced_steps = 0  # rows stepped with fewer candidates than wished

    def tick(self, frame: float, most: int | None = None) -> int:
        """Plan the next chunk of the agents most urgently due by world frame `frame`.

        Tries `most` candidates at most. Returns how many were stepped; 0 when none is due.
        """
        batch = self.schedule(frame, most)
        if batch is None:
            return 0
        outputs = self._engine.step(batch.gender, pad(batch.inputs, self._sizes))
        self.apply(batch, cut(outputs, len(batch.rows)))
        return len(batch.rows)

    def schedule(self, frame: float, most: int | None = None) -> Batch | None:
        """The most urgent agent and, in order of urgency, those that fit into its batch."""
        slots = self._table.rows
        rows = self._playback.due(frame)
        rows = rows[slots.gender[rows] == slots.gender[rows[:1]]]
        if not len(rows):
            return None
        seed, gait = slots.planned.seed.take(rows), slots.planned.gait.take(rows)
        gait = self._steering.advance(gait, self._paths.at(rows, gait.waypoint))
        goals = self._paths.at(rows, gait.waypoint)
        gait = self._steering.decide(gait, seed, goals)
        wished = self._steering.candidates(gait.mode)
        tried = wished if most is None else np.minimum(wished, most)
        alike = np.flatnonzero(tried == tried[0])[: self._sizes[-1]]
        rows, seed, gait, goals = rows[alike], seed.take(alike), gait.take(alike), goals.take(alike)
        count = int(tried[0])
        return Batch(
            rows=rows,
            gender=GENDERS[slots.gender[rows[0]]],
            seed=seed,
            gait=gait,
            goals=goals,
            inputs=gather(slots, rows, seed, gait, goals, count, self._steering),
            candidates=count,
            reduced=wished[alike] > count,
        )

    def apply(self, batch: Batch, outputs: StepOutputs) -> None:
        """Put the new frames into playback; their end is where the next step starts."""
        slots, rows = self._table.rows, batch.rows
        start = batch.seed.translation[:, -1]
        is_broken = broken(start, outputs)
        translation = np.where(is_broken[:, None, None], start[:, None], outputs.translation)
        gait = observe(batch.gait, start, translation, batch.goals)
        flags = np.where(slots.replanned[rows], ChunkFlag.REPLANNED, ChunkFlag.NONE)
        flags |= np.where(gait.arrived & ~batch.gait.arrived, ChunkFlag.ARRIVED, ChunkFlag.NONE)
        flags |= np.where(batch.reduced, ChunkFlag.REDUCED, ChunkFlag.NONE)
        seed = Seeds(
            markers=outputs.next_seed_markers,
            translation=translation[:, -SEED_FRAMES:],
            rotations=outputs.rotations[:, -SEED_FRAMES:],
        )
        chunks = Chunks(
            translation=translation,
            rotations=outputs.rotations,
            contacts=outputs.contacts > 0.5,
            flags=flags.astype(np.uint8),
            goal_revision=slots.goal_revision[rows],
            candidates=np.full(len(rows), batch.candidates, np.int16),
            end=Motion(seed, gait),
        )
        if is_broken.any():
            chunks = self._mend(rows, chunks, np.flatnonzero(is_broken))
        self._playback.append(rows, chunks)
        slots.replanned[rows] = False
        self.reduced_steps += int(batch.reduced.sum())

    def _mend(self, rows: Index, chunks: Chunks, broken_rows: Index) -> Chunks:
        """Let agents that could not be stepped stand where they were; the others are untouched."""
        mended = chunks.take(np.arange(len(rows)))  # a copy: the arrays are the engine's
        for row in broken_rows:
            motion = self._reset(int(rows[row]))
            mended.translation[row] = motion.seed.translation[0, -1]
            mended.rotations[row] = motion.seed.rotations[0, -1]
            mended.contacts[row] = True
            mended.flags[row] |= ChunkFlag.FIRST  # the pose jumps: do not blend into it
            motion.gait.waypoint[:] = chunks.end.gait.waypoint[row]
            mended.end.put(np.array([row]), motion)
            self.resets += 1
        return mended
