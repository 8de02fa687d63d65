"""Agents enter slots and leave them: new ones, recorded ones, and reset ones."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.engines.models import Loaded, LoadedModels
from wayfarer.spec import GENDERS, NEW_FRAMES
from wayfarer.world.agents.agent import AgentChange, AgentSpec
from wayfarer.world.agents.behaviour import Agent
from wayfarer.world.agents.heading import heading_of
from wayfarer.world.agents.phases import Phases
from wayfarer.world.agents.records import AgentRecord
from wayfarer.world.agents.registry import Registry, Session
from wayfarer.world.agents.slots import Motion, SlotTable
from wayfarer.world.agents.spawn import Spawner
from wayfarer.world.agents.style import style_of
from wayfarer.world.agents.timeline import Timeline
from wayfarer.world.output.ground import Footing, standing
from wayfarer.world.output.legs import Legs, measure_legs
from wayfarer.world.rows import Double

MEASURED: Final = 1024
"""Maximum number of shapes whose legs are remembered."""

LATE_FRAMES: Final = NEW_FRAMES / 2
"""Frames by which the next chunk of an agent from another server may be late: readers have more in
reserve, and a moved schedule would stop everybody for a whole primitive.
"""


class Population:
    """The agents of a world in their slots and phases."""

    def __init__(
        self,
        *,
        bodies: Mapping[str, BodyModel],
        start_poses: NDArray[np.float32],
        phases: int,
        lead: int,
        registry: Registry,
        table: SlotTable,
        timeline: Timeline,
        models: LoadedModels,
    ) -> None:
        """Steps are spread over `phases` phases; `lead` chunks are planned ahead."""
        self._lead = lead
        self._registry = registry
        self._table = table
        self._timeline = timeline
        self._models = models
        self._roster = models.roster()
        self._legs = lru_cache(MEASURED)(
            lambda gender, betas: measure_legs(bodies[gender], np.array(betas))
        )
        self.spawner = Spawner(bodies, start_poses)
        self.phases = Phases(phases)

    def measure(self, specs: Iterable[AgentSpec]) -> None:
        """Measures bodies whose agents are about to enter. Thread-safe, and costly."""
        for spec in specs:
            self._legs(spec.gender, spec.betas)

    def add(
        self,
        session: Session,
        specs: Sequence[AgentSpec],
        seeds: Sequence[Motion],
        now: float,
        names: Sequence[str] = (),
    ) -> list[Agent]:
        """Starts agents, with these ids if they are given. There must be free slots. Raises
        NotFound for models not loaded.
        """
        if not specs:
            return []
        count = len(specs)
        for spec in specs:
            if spec.model:
                self._models.named(spec.model)
        models = [spec.model for spec in specs]
        slots = self._enter(specs, Motion.join(seeds), [0] * count, models, now)
        agents = []
        with self._all_or_none(slots):
            self._table.rows.footing.put(np.array(slots), standing([s.floor for s in specs]))
            ids = names or [""] * count
            for spec, slot, name in zip(specs, slots, ids, strict=True):
                agent = self._registry.add_agent(session, spec, slot, now, name)
                agent.path_start = spec.position
                agents.append(self._settle(agent, session))
        return agents

    def remove(self, agent: Agent) -> None:
        """Removes an agent; its planned frames are discarded."""
        self._leave(agent.slot)
        self._registry.remove_agent(agent)

    def change(self, agent: Agent, change: AgentChange) -> None:
        """Makes a change that has been checked."""
        name, foot_lock = change.name, change.foot_lock
        spec = agent.spec if name is None else replace(agent.spec, name=name)
        agent.spec = spec if foot_lock is None else replace(spec, foot_lock=foot_lock)
        self._table.rows.foot_lock[agent.slot] = agent.spec.foot_lock

    def move(self, agent: Agent, model: Loaded) -> bool:
        """Moves it with a model from its next step on; returns whether the model changes.

        Raises NotFound when the model has been unloaded.
        """
        numbers, slot = self._table.rows.model, agent.slot
        if numbers[slot] == model.number:
            return False
        self._models.change(self._roster, int(numbers[slot]), model)
        numbers[slot] = model.number
        return True

    def stand_again(self, slot: int) -> Motion:
        """A stand at the place and heading of an agent's planned motion, one row."""
        seed, spec = self._table.rows.planned.seed, self._registry.by_slot[slot].spec
        x, y, _ = (float(v) for v in seed.translation[slot, -1])
        heading = heading_of(seed.rotations[slot, -1, 0])
        return self.spawner.stand(replace(spec, position=(x, y), heading=heading))

    def put(self, session: Session, records: Sequence[AgentRecord], now: float) -> list[Agent]:
        """Resumes recorded agents. There must be free slots and no agents of their ids."""
        if not records:
            return []
        entered = self._enter(
            [record.spec for record in records],
            Motion.join([record.motion for record in records]),
            [record.seq for record in records],
            [record.model for record in records],
            now,
        )
        with self._all_or_none(entered):
            self._restore(entered, records)
            return [
                self._go_on(session, record, slot)
                for record, slot in zip(records, entered, strict=True)
            ]

    def _restore(self, entered: Sequence[int], records: Sequence[AgentRecord]) -> None:
        slots = self._table.rows
        rows = np.array(entered)
        slots.footing.put(rows, Footing.join([record.footing for record in records]))
        slots.goal_revision[entered] = [record.goal_revision for record in records]
        slots.revised_chunk[entered] = [record.seq - 1 for record in records]

    def keep_schedule(self, slots: Sequence[int], shown_at: Double, now: float) -> None:
        """Schedules the next chunk of each slot at `shown_at` [N], Unix seconds.

        If that is past, all of them are shown later by the same number of primitives.
        """
        rows, columns = np.array(slots, np.int64), self._table.rows
        shown = np.array([round(self._timeline.frame(at)) for at in shown_at.tolist()], np.int64)
        late = self._timeline.frame(now) - LATE_FRAMES - shown.min(initial=np.iinfo(np.int64).max)
        shown += NEW_FRAMES * max(ceil(late / NEW_FRAMES), 0)
        before, genders = columns.start_frame[rows].tolist(), columns.gender[rows].tolist()
        columns.start_frame[rows] = shown - NEW_FRAMES * columns.planned_chunks[rows]
        after = columns.start_frame[rows].tolist()
        for old, new, gender in zip(before, after, genders, strict=True):
            self.phases.leave(old, gender)
            self.phases.enter_at(new, gender)

    @contextmanager
    def _all_or_none(self, slots: Sequence[int]) -> Iterator[None]:
        """Releases acquired slots, with or without agents, on an error."""
        try:
            yield
        except Exception:
            for slot in slots:
                if agent := self._registry.by_slot.get(slot):
                    self._registry.remove_agent(agent)
                self._leave(slot)
            raise

    def _leave(self, slot: int) -> None:
        slots = self._table.rows
        self.phases.leave(int(slots.start_frame[slot]), int(slots.gender[slot]))
        self._models.leave(self._roster, int(slots.model[slot]))
        self._table.release(slot)

    def _go_on(self, session: Session, record: AgentRecord, slot: int) -> Agent:
        agent = Agent(
            agent_id=record.agent_id,
            alias=record.alias,
            session_id=session.session_id,
            spec=record.spec,
            slot=slot,
            created_at=record.created_at,
            path=record.path,
            passed=record.passed,
            path_start=record.path_start,
            behaviour=record.behaviour,
            part=record.part,
            begun=record.begun,
        )
        session.last_alias = max(session.last_alias, record.alias)
        return self._settle(self._registry.enter(agent), session)

    def _settle(self, agent: Agent, session: Session) -> Agent:
        """Enters the agent into its slot."""
        slots = self._table.rows
        slots.agent_id[agent.slot] = agent.agent_id
        slots.alias[agent.slot] = agent.alias
        slots.session[agent.slot] = session.number
        slots.scene[agent.slot] = session.scene
        # a recorded session is replayed agent by agent, each alone
        slots.avoids[agent.slot] = session.spec.avoid and not session.spec.record
        return agent

    def _enter(
        self,
        specs: Sequence[AgentSpec],
        motions: Motion,
        seqs: Sequence[int],
        models: Sequence[str],
        now: float,
    ) -> list[int]:
        """Slots whose next chunks have the numbers `seqs` and continue from `motions`.

        `models`: stamps or names of the models that should move them; empty: the default model.
        """
        legs = Legs.join([self._legs(spec.gender, spec.betas) for spec in specs])
        entered = self._table.acquire(len(specs))
        slots, rows = self._table.rows, np.array(entered)
        genders = [GENDERS.index(spec.gender) for spec in specs]
        slots.gender[rows] = genders
        slots.model[rows] = [self._models.enter(self._roster, stamp) for stamp in models]
        slots.noise_seed[rows] = np.array([spec.noise_seed for spec in specs], np.uint64)
        slots.style.put(rows, style_of(slots.noise_seed[rows]))
        slots.betas[rows] = [spec.betas for spec in specs]
        slots.foot_lock[rows] = [spec.foot_lock for spec in specs]
        slots.legs.put(rows, legs)
        slots.committed.put(rows, motions)
        slots.planned.put(rows, motions)
        slots.sent_chunks[rows] = slots.planned_chunks[rows] = seqs
        earliest = ceil(self._timeline.frame(now)) + self._lead * NEW_FRAMES
        first = [self.phases.next_frame(self.phases.enter(g), earliest) for g in genders]
        slots.start_frame[rows] = np.array(first) - NEW_FRAMES * np.array(seqs)
        return entered
