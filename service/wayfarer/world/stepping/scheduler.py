"""Decides which agents are stepped, and when; their new frames enter playback."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from wayfarer.engines.dummy import dummy_inputs
from wayfarer.engines.engine import StepOutputs, no_obstacles
from wayfarer.engines.models import LoadedModels
from wayfarer.engines.padding import cut, fitting, pad, pick, whole
from wayfarer.spec import FPS, GENDERS, NEW_FRAMES, SEED_FRAMES
from wayfarer.world.agents.agent import ChunkFlag, Sight
from wayfarer.world.agents.faults import ENGINE_CALLS, Faults, NotFiniteError, Stage, check_finite
from wayfarer.world.agents.slots import Motion, Seeds, SlotTable
from wayfarer.world.agents.style import sets_off
from wayfarer.world.goals.path_columns import PathColumns
from wayfarer.world.goals.steering import observe
from wayfarer.world.rows import Flags, Float, Index, Int8
from wayfarer.world.stepping.batch import gather
from wayfarer.world.stepping.budget import DegradationLevel
from wayfarer.world.stepping.engine_call import (
    Batch,
    Call,
    Launch,
    PendingStep,
    Ready,
    at_once,
)
from wayfarer.world.stepping.guards import FELL, FOLDED, got_up
from wayfarer.world.stepping.guide import Guide, NextTarget
from wayfarer.world.stepping.mirror import is_mirrored, mirror_inputs, mirror_outputs
from wayfarer.world.stepping.new_frames import CORRECTIONS, NewFrames, broken, corrected
from wayfarer.world.stepping.playback import Chunks, Playback
from wayfarer.world.stepping.rules import MODEL
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.stepping.unstepped import Unstepped

PATIENCE: Final = (0.0, 0.375)
"""Maximum wait of a due agent for others while time is short, for the sights NEAR and FAR: a share
of the time after which its primitive is left out, so that no wait is endless.
"""

REPLANNED, ARRIVED, REDUCED, FIRST = (
    np.uint8(flag)
    for flag in (ChunkFlag.REPLANNED, ChunkFlag.ARRIVED, ChunkFlag.REDUCED, ChunkFlag.FIRST)
)


class Scheduler:
    """Steps due agents, those of one model and gender at a time."""

    def __init__(
        self,
        *,
        table: SlotTable,
        playback: Playback,
        paths: PathColumns,
        models: LoadedModels,
        settings: WorldSettings,
        reset: Callable[[int], Motion],
        planned: Callable[[Index, Index, int], None],
        fell: Callable[[Index, Int8, Float, Float], None],
        guide: Guide,
        mirrors: bool,
        shares: Float,
        faults: Faults,
    ) -> None:
        """`reset(slot)` returns the standing motion from which a fallen agent continues.

        `planned(slots, seqs, candidates)` is called with all new chunks, with 0 candidates for held
        ones. `fell(slots, modes, upright, hips)` is called before that with agents that get up, and
        their posture (see guards.py). `mirrors`: half of all agents are moved in a mirror.
        `shares`: how far markers follow legs (see footlock.py).
        """
        self._table = table
        self._playback = playback
        self._paths = paths
        self._models = models
        self._steering = settings.steering
        self._reset = reset
        self._sizes = settings.batch_sizes
        self._planned = planned
        self._fell = fell
        self._guide = guide
        self._rules = settings.rules
        self._mirrors = mirrors
        # righting knows the places of our markers
        self._corrections = [name for name in CORRECTIONS if mirrors or name != "righting"]
        self._shares = shares
        self._faults = faults
        self._single_threaded = settings.single_threaded
        self._company = settings.batch_lookahead_s * FPS  # frames
        self._full = settings.batch_multiple
        self._patience = NEW_FRAMES * (settings.lead + 1) * np.array(PATIENCE)
        self._engine_calls = 0  # begun so far
        self.under_way = 0  # calls that are not finished
        self.resets = 0  # rows so far that could not be shown, or had fallen
        self.mended_steps = 0  # rows with a knee that was put back within its limits
        self.reduced_steps = 0  # rows stepped with fewer candidates than requested
        self.unstepped = Unstepped(
            table=table,
            playback=playback,
            steering=settings.steering,
            faults=faults,
            due=self._due,
            next_step=self._next,
            append=self._append,
            reset=reset,
        )

    @property
    def is_any_distant(self) -> bool:
        """Whether some agents are not near."""
        slots = self._table.rows
        return bool((slots.active & (slots.sight > Sight.NEAR)).any())

    @property
    def held_share(self) -> float:
        """Share of the agents whose last chunk was held, or that coasted."""
        slots = self._table.rows
        return float(slots.held[slots.active].mean()) if slots.active.any() else 0.0

    def begin(
        self, frame: float, level: DegradationLevel | None = None, launch: Launch = at_once
    ) -> PendingStep | None:
        """Starts an engine call for agents that are due by world frame `frame`, or soon after it;
        see `schedule`.

        Tries as many candidates as steering requests, or fewer if `level` allows fewer. None: there
        is no batch to step. Until `finish`, agents in the call are not due; the plan of an agent
        that is replanned or leaves is lost.
        """
        ready = self.schedule(frame, level)
        if ready is None:
            return None
        batch, inputs, call = ready
        outputs = launch(call)
        self._engine_calls += 1
        self.under_way += 1
        self._table.rows.engine_call[batch.rows] = self._engine_calls
        size = Call(len(inputs.goal), batch.candidates)
        return PendingStep(self._engine_calls, batch, size, outputs)

    def finish(self, step: PendingStep) -> int:
        """Plans the next chunk of the agents in the call. Returns their number."""
        slots, rows = self._table.rows, step.batch.rows
        still = slots.engine_call[rows] == step.number
        slots.engine_call[rows[still]] = 0
        self.under_way -= 1
        kept = np.flatnonzero(still)
        try:
            outputs = cut(step.outputs(), len(rows))
        except Exception as error:
            self._step_apart(step.batch.take(kept), error)
            return len(rows)
        if len(kept) == len(rows):
            self._apply(step.batch, outputs)
        elif len(kept):
            self._apply(step.batch.take(kept), pick(outputs, kept))
        return len(rows)

    def schedule(self, frame: float, level: DegradationLevel | None = None) -> Ready | None:
        """A batch with the agent that is due first, and the agents that fit into it whose next
        chunks are shown first. So a replanned agent, which has less time, goes before others.

        Nobody is stepped before somebody is due: an agent with a new goal would find no company.
        """
        slots = self._table.rows
        rows = self._due(frame + self._company)
        if level is not None and level.by_sight:
            rows = rows[slots.sight[rows] < Sight.ROOT]  # the others coast
        is_due = self._playback.is_due(rows, frame)
        if not is_due.any():
            return None
        if level is not None and level.by_sight and slots.sight[rows].any():
            rows, due = self._near_first(rows, frame)
        else:
            alike = self._alike(rows, int(is_due.argmax()))
            rows, due = rows[alike], int(is_due[alike].sum())
        rows = rows[: whole(due, len(rows), self._sizes, self._full)]
        if not len(rows):
            return None
        try:
            return self._ready(self._batch(rows, level))
        except Exception as error:
            sound = self._faults.sound(
                rows, lambda some: self._ready(self._batch(rows[some], level)), error
            )
            return self._ready(self._batch(rows[sound], level)) if len(sound) else None

    def _batch(self, rows: Index, level: DegradationLevel | None) -> Batch:
        """A batch of the slots [A] that are tried with as many candidates as the first."""
        slots = self._table.rows
        self._faults.stage = Stage.STEERING
        start, course = self._next(rows)
        asked = self._steering.candidates(start.gait.mode)
        tried = asked if level is None else np.minimum(asked, level.candidates)
        count = int(tried[0])
        if len(together := np.flatnonzero(tried == count)) < len(rows):
            rows, asked = rows[together], asked[together]
            start = start.take(together)
            course = NextTarget(course.ahead.take(together), course.judged.take(together))
        self._faults.stage = Stage.INPUTS
        seed, gait = start.seed, start.gait
        # a single candidate is not scored
        obstacles = self._guide.obstacles(rows, seed) if count > 1 else no_obstacles(len(rows))
        return Batch(
            rows=rows,
            model=int(slots.model[rows[0]]),
            gender=GENDERS[slots.gender[rows[0]]],
            start=start,
            goals=course.judged,
            inputs=gather(slots, rows, seed, gait, course.ahead, count, self._steering, obstacles),
            candidates=count,
            reduced=asked > count,
            mirrored=is_mirrored(slots.noise_seed[rows])
            & (self._mirrors and self._rules.acts("mirror")),
        )

    def apply(self, batch: Batch, outputs: StepOutputs) -> None:
        """Puts the new frames into playback; the next step starts at their end."""
        slots, rows, rules = self._table.rows, batch.rows, self._rules
        seed, before = batch.start.seed, batch.start.gait
        start = seed.translation[:, -1]
        outputs = mirror_outputs(outputs, batch.mirrored)
        is_broken = broken(start, outputs)
        translation, rotations = outputs.translation, outputs.rotations
        markers, contacts = outputs.next_seed_markers, outputs.contacts > 0.5
        if is_broken.any():
            translation[is_broken] = start[is_broken, None]
            rotations[is_broken] = seed.rotations[is_broken, -1:]
        rules.tell(MODEL, rows, translation, rotations)
        frames = NewFrames(translation, rotations, contacts, markers)
        legs, mode = slots.legs.take(rows), before.mode
        lock = slots.foot_lock[rows], self._shares
        for acting in rules.in_turn(*self._corrections):
            mended, upright, hips = corrected(acting, mode, legs, lock, seed, frames)
            self.mended_steps += int(np.count_nonzero(mended))
            for name in acting[-1:]:
                rules.tell(name, rows, translation, rotations)
        last = slice(-SEED_FRAMES, None)
        gait = observe(before, start, translation, batch.goals)
        flags = REPLANNED * slots.replanned[rows] + REDUCED * batch.reduced
        flags += ARRIVED * (gait.arrived & ~before.arrived)
        flags += FIRST * slots.coasted[rows]  # coasted agents had another pose
        chunks = Chunks(
            translation=translation,
            rotations=rotations,
            contacts=contacts,
            flags=flags,
            goal_revision=slots.goal_revision[rows],
            candidates=np.full(len(rows), batch.candidates, np.int16),
            end=replace(
                batch.start,
                seed=Seeds(markers, translation[:, last], rotations[:, last]),
                gait=gait,
            ),
        )
        gets_up = is_broken
        if rules.acts("getting up"):
            gets_up = is_broken | (upright < FELL) | (hips < FOLDED)
        if gets_up.any():
            chunks.flags[is_broken] |= FIRST  # it may jump
            which = np.flatnonzero(gets_up)
            unknown = np.where(is_broken[which], np.float32(np.nan), np.float32(0))
            posture = upright[which] + unknown, hips[which] + unknown
            self._fell(rows[which], mode[which], *posture)
            chunks = self._mend(rows, chunks, seed, which)
        self._append(rows, chunks, batch.candidates)
        self.reduced_steps += int(np.count_nonzero(batch.reduced))
        if self._faults.contained and is_broken.any():
            what = NotFiniteError("a step is not finite, or moves the body too far")
            self._faults.agents(rows[is_broken], Stage.ENGINE, what)

    def _due(self, frame: float) -> Index:
        """Like `Playback.due`, without agents that a fault holds."""
        rows = self._playback.due(frame)
        return rows[~self._faults.held(rows)] if self._faults.any else rows

    def _ready(self, batch: Batch) -> Ready:
        """The batch with its engine inputs, including padding, and the call."""
        inputs = pad(mirror_inputs(batch.inputs, batch.mirrored), self._sizes)
        engine = self._models.numbered(batch.model).engine
        step = (engine.single_threaded if self._single_threaded else engine).step
        return batch, inputs, partial(step, batch.gender, inputs)

    def _step_apart(self, batch: Batch, error: Exception) -> None:
        """Retries a batch for which the engine failed, then finds the agents that cause this."""
        if not len(batch.rows) or not self._faults.contained:
            self._faults.nobody(Stage.ENGINE, error)
            return

        def step(some: Index) -> StepOutputs:
            _, _, call = self._ready(batch.take(some))
            return cut(call(), len(some))

        self._faults.stage = Stage.ENGINE
        try:
            parts = [(everyone := np.arange(len(batch.rows)), step(everyone))]
            self._faults.nobody(Stage.ENGINE, error)  # it has failed once
        except Exception as again:
            self._try_engine(batch)
            parts = self._faults.split(batch.rows, step, again, ENGINE_CALLS)
        for some, outputs in parts:
            self._apply(batch.take(some), outputs)

    def _try_engine(self, batch: Batch) -> None:
        """Steps a dummy. If it fails too, it raises: the fault is the engine's, no agent's."""
        inputs = pad(dummy_inputs(1, batch.candidates), self._sizes)
        self._models.numbered(batch.model).engine.step(batch.gender, inputs)

    def _apply(self, batch: Batch, outputs: StepOutputs) -> None:
        """`apply`, with faults contained."""
        self._faults.stage = Stage.RULES
        try:
            self.apply(batch, outputs)
        except Exception as error:
            self._faults.split(
                batch.rows, lambda some: self.apply(batch.take(some), pick(outputs, some)), error
            )

    def _alike(self, rows: Index, one: int = 0) -> Flags:
        """Which agents may be in one batch with the agent `one`."""
        slots = self._table.rows
        model, gender = slots.model[rows], slots.gender[rows]
        alike: Flags = (model == model[one]) & (gender == gender[one])
        return alike

    def _near_first(self, rows: Index, frame: float) -> tuple[Index, int]:
        """The rows of a batch, and how many of them cannot wait.

        A due agent that is not near waits for agents that cannot wait (`PATIENCE`), and joins their
        batch: a call with few rows takes half as long as a full one, so small calls would delay
        everybody. When all due agents can wait, they are stepped all the same, at most `_full` in a
        call, and agents that become due meanwhile wait for that call.
        """
        is_due, waited = self._playback.is_due(rows, frame), self._playback.waited(rows, frame)
        patience = np.where(is_due, self._patience[self._table.rows.sight[rows]], 0)
        must = is_due & (waited >= patience)
        order = np.lexsort((patience - waited, ~is_due, ~must))
        order = order[self._alike(rows[order])]
        if count := int(must[order].sum()):
            due = int(is_due[order].sum())
            most = max(fitting(count, self._sizes), min(due, self._full))
            return rows[order[:most]], min(max(count, due), most)
        order = order[: self._full]
        return rows[order], int(is_due[order].sum())

    def _next(self, rows: Index) -> tuple[Motion, NextTarget]:
        """The motion that slots continue from, with their next gait, and the targets of a step."""
        slots, faults = self._table.rows, self._faults
        outer, faults.stage = faults.stage, Stage.STEERING
        start = slots.planned.take(rows)
        goals = self._paths.at(rows, start.gait.waypoint)
        gait = self._steering.advance(start.gait, goals)
        if gait is not start.gait:
            start.gait, goals = gait, self._paths.at(rows, gait.waypoint)
        ready = sets_off(
            slots.noise_seed[rows], slots.planned_chunks[rows], self._steering.reactions
        )
        faults.stage = Stage.WAY
        course = self._guide.course(rows, start, goals)
        faults.stage = Stage.STEERING
        start.gait = self._steering.decide(start.gait, start.seed, course.ahead, ready)
        faults.stage = outer
        return start, course

    def _append(self, rows: Index, chunks: Chunks, candidates: int) -> None:
        slots = self._table.rows
        seed = chunks.end.seed
        ends = seed.translation, seed.rotations, seed.markers
        check_finite("new frames", chunks.translation, chunks.rotations, *ends)
        self._planned(rows, slots.planned_chunks[rows], candidates)
        self._playback.append(rows, chunks)
        slots.replanned[rows] = False
        slots.coasted[rows] = False
        slots.held[rows] = not candidates

    def _mend(self, rows: Index, chunks: Chunks, seed: Seeds, mended_rows: Index) -> Chunks:
        """Makes agents get up to a stand in place; the others are unchanged."""
        mended = chunks.take(np.arange(len(rows)))  # a copy: the arrays are the engine's
        stands = Motion.join([self._reset(int(rows[row])) for row in mended_rows])
        frames = got_up(seed.take(mended_rows), stands)
        mended.translation[mended_rows], mended.rotations[mended_rows] = frames
        mended.contacts[mended_rows] = True
        end = chunks.end.take(mended_rows)
        stands.gait.waypoint, stands.memory, stands.aims = end.gait.waypoint, end.memory, end.aims
        mended.end.put(mended_rows, stands)
        self.resets += len(mended_rows)
        return mended
