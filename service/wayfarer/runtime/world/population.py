"""Agents enter slots and leave them: new, as records of themselves, or to stand again."""

from collections.abc import Mapping
from dataclasses import replace
from math import ceil

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.runtime.agent import AgentChange, AgentSpec
from wayfarer.runtime.engines.models import Loaded, Models
from wayfarer.runtime.feet.legs import measure_legs
from wayfarer.runtime.settings import WorldSettings
from wayfarer.runtime.stepping.phases import Phases
from wayfarer.runtime.stepping.timeline import Timeline
from wayfarer.runtime.world.handover import AgentRecord
from wayfarer.runtime.world.heading import heading_of
from wayfarer.runtime.world.orders import Orders
from wayfarer.runtime.world.registry import Agent, Registry, Session
from wayfarer.runtime.world.slots import Motion, SlotTable
from wayfarer.runtime.world.spawn import Spawner
from wayfarer.spec import GENDERS, NEW_FRAMES


class Population:
    """The agents of a world in their slots and phases."""

    def __init__(
        self,
        bodies: Mapping[str, BodyModel],
        start_poses: NDArray[np.float32],
        settings: WorldSettings,
        registry: Registry,
        table: SlotTable,
        timeline: Timeline,
        orders: Orders,
        models: Models,
    ) -> None:
        self._bodies = bodies
        self._lead = settings.lead
        self._registry = registry
        self._table = table
        self._timeline = timeline
        self._orders = orders
        self._models = models
        self._roster = models.roster()
        self.spawner = Spawner(bodies, start_poses)
        self.phases = Phases(settings.phases)

    def add(self, session: Session, spec: AgentSpec, seed: Motion, now: float) -> Agent:
        """Let an agent begin. There must be a free slot."""
        slot = self._enter_slot(spec, seed, 0, now)
        agent = self._registry.add_agent(session, spec, slot, now)
        agent.path_start = spec.position
        self._orders.restore(agent)
        return agent

    def remove(self, agent: Agent) -> None:
        """Its planned frames are thrown away."""
        slots = self._table.rows
        self.phases.leave(int(slots.start_frame[agent.slot]), int(slots.gender[agent.slot]))
        self._models.leave(self._roster, int(slots.model[agent.slot]))
        self._table.release(agent.slot)
        self._registry.remove_agent(agent)

    def change(self, agent: Agent, change: AgentChange) -> None:
        """Carry out a change that has been checked."""
        name, foot_lock = change.name, change.foot_lock
        spec = agent.spec if name is None else replace(agent.spec, name=name)
        agent.spec = spec if foot_lock is None else replace(spec, foot_lock=foot_lock)
        self._table.rows.foot_lock[agent.slot] = agent.spec.foot_lock

    def move(self, agent: Agent, model: Loaded) -> bool:
        """Let it be moved by a model from its next step on; returns whether that is another.

        Raises NotFound when the model has been unloaded.
        """
        numbers, slot = self._table.rows.model, agent.slot
        if numbers[slot] == model.number:
            return False
        self._models.change(self._roster, int(numbers[slot]), model)
        numbers[slot] = model.number
        return True

    def stand_again(self, slot: int) -> Motion:
        """A stand where and as an agent's planned motion has left it, one row."""
        seed, spec = self._table.rows.planned.seed, self._registry.by_slot[slot].spec
        x, y, _ = (float(v) for v in seed.translation[slot, -1])
        heading = heading_of(seed.rotations[slot, -1, 0])
        return self.spawner.stand(replace(spec, position=(x, y), heading=heading))

    def take(self, agent: Agent) -> AgentRecord:
        """The agent as of the last chunk sent; it stays where it is."""
        slots, row = self._table.rows, np.array([agent.slot])
        motion = self._orders.at_rest(agent)
        return AgentRecord(
            agent_id=agent.agent_id,
            alias=agent.alias,
            spec=agent.spec,
            created_at=agent.created_at,
            seq=int(slots.sent_chunks[agent.slot]),
            motion=motion,
            feet=slots.feet.take(row) if slots.feet_begun[agent.slot] else None,
            goal_revision=int(slots.goal_revision[agent.slot]),
            path=agent.path,
            passed=agent.passed,
            path_start=agent.path_start,
            wander=agent.wander,
        )

    def put(self, session: Session, record: AgentRecord, now: float) -> Agent:
        """Let a recorded agent go on. There must be a free slot and no agent of its id."""
        slot = self._enter_slot(record.spec, record.motion, record.seq, now)
        slots = self._table.rows
        if record.feet is not None:
            slots.feet.put(np.array([slot]), record.feet)
            slots.feet_begun[slot] = True
        slots.goal_revision[slot] = record.goal_revision
        slots.revised_chunk[slot] = record.seq - 1
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
            wander=record.wander,
        )
        session.last_alias = max(session.last_alias, record.alias)
        self._orders.restore(agent)
        return self._registry.enter(agent)

    def _enter_slot(self, spec: AgentSpec, motion: Motion, seq: int, now: float) -> int:
        """A slot whose next chunk has number `seq` and goes on from `motion`."""
        slot = self._table.acquire()
        slots, row = self._table.rows, np.array([slot])
        slots.gender[slot] = gender = GENDERS.index(spec.gender)
        slots.model[slot] = self._models.enter(self._roster)
        slots.noise_seed[slot] = spec.noise_seed
        slots.betas[slot] = spec.betas
        slots.foot_lock[slot] = spec.foot_lock
        slots.legs.put(row, measure_legs(self._bodies[spec.gender], np.array(spec.betas)))
        slots.committed.put(row, motion)
        slots.planned.put(row, motion)
        slots.sent_chunks[slot] = slots.planned_chunks[slot] = seq
        earliest = ceil(self._timeline.frame(now)) + self._lead * NEW_FRAMES
        first = self.phases.next_frame(self.phases.enter(gender), earliest)
        slots.start_frame[slot] = first - seq * NEW_FRAMES
        return slot
