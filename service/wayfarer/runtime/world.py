"""The synchronous core: sessions, agents and goals over slots, scheduler and playback.

Time is always an argument: seconds, the same line for all calls (Unix time in the service, any
in offline use). The same calls give the same motion. Not thread-safe, `prepare` excepted.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import ceil

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.errors import ResourceExhausted
from wayfarer.runtime.agent import AgentInfo, AgentSpec, Goal, MotionChunk, SessionInfo
from wayfarer.runtime.budget import Budget
from wayfarer.runtime.checks import check_goal, check_path, check_session_id, check_spec
from wayfarer.runtime.cleanup import clean_feet
from wayfarer.runtime.engine import Engine
from wayfarer.runtime.heading import heading_of
from wayfarer.runtime.legs import measure_legs
from wayfarer.runtime.paths import Paths
from wayfarer.runtime.playback import Playback
from wayfarer.runtime.registry import Agent, Registry, Session
from wayfarer.runtime.scheduler import Scheduler
from wayfarer.runtime.settings import WorldSettings
from wayfarer.runtime.slots import Mode, Motion, SlotTable
from wayfarer.runtime.spawn import Spawner
from wayfarer.runtime.views import agent_info, motion_chunks
from wayfarer.spec import FPS, GENDERS, NEW_FRAMES


class World:
    """Sessions of agents who walk. `tick` moves them all."""

    def __init__(
        self,
        engine: Engine,
        bodies: Mapping[str, BodyModel],
        start_poses: NDArray[np.float32],
        settings: WorldSettings | None = None,
    ) -> None:
        """`bodies` by gender; `start_poses` [P, 22, 4] from `spawn.load_start_poses`."""
        self.settings = settings or WorldSettings()
        self._bodies = bodies
        self._spawner = Spawner(bodies, start_poses)
        self._table = SlotTable(self.settings.limits.agents)
        self._playback = Playback(self._table.rows, self.settings.lead)
        self._paths = Paths(self._table.rows, self.settings.limits.path_goals)
        self._scheduler = Scheduler(
            self._table,
            self._playback,
            self._paths,
            engine,
            self.settings.steering,
            self._stand_again,
            self.settings.batch_sizes,
        )
        self._budget: Budget | None = None
        if self.settings.budget is not None:
            wished = [search.candidates for search in self.settings.steering.searches.values()]
            self._budget = Budget(max(wished), self.settings.budget)
        self._registry = Registry(self.settings.limits)
        # How many agents of each gender have their steps in each phase.
        self._phase_load = np.zeros((self.settings.phases, len(GENDERS)), np.int64)
        self._epoch = 0.0  # time of world frame 0

    # Time

    def tick(self, now: float) -> list[MotionChunk]:
        """Step all agents that are due and return the chunks whose time has come."""
        sent = self.collect(now)
        while self.step(now):
            sent += self.collect(now)
        return sent

    def step(self, now: float) -> int:
        """One engine call for the agents most urgently due. Returns how many were stepped."""
        frame = self._frame(now)
        if self._budget is None:
            return self._scheduler.tick(frame)
        slack = self._playback.slack(frame) / FPS
        return self._scheduler.tick(frame, self._budget.candidates(now, slack))

    def spent(self, now: float, seconds: float) -> None:
        """Tell the budget that a step has ended, and how long it took."""
        if self._budget is not None:
            self._budget.spent(now, seconds)

    def collect(self, until: float) -> list[MotionChunk]:
        """The planned chunks that are to be shown by `until`, in order of that."""
        chunks: list[MotionChunk] = []
        for sent in self._playback.send(self._frame(until)):
            clean_feet(self._table.rows, sent)
            chunks += motion_chunks(sent, self._registry.by_slot, self._time)
        return chunks

    def next_event(self) -> float | None:
        """When the next agent is due or the next chunk is to be sent; None without agents."""
        frame = self._playback.next_event()
        return None if frame is None else self._time(frame)

    def behind(self, now: float) -> float:
        """Seconds by which the next chunk to be sent is overdue; 0 when none is."""
        frame = self._playback.next_send()
        return 0.0 if frame is None else max(now - self._time(frame), 0.0)

    def advance(self, until: float) -> Iterator[MotionChunk]:
        """Run from event to event, without waiting, as far as `until`."""
        while (event := self.next_event()) is not None and event <= until:
            yield from self.tick(event)

    def rebase(self, seconds: float) -> None:
        """Move everything not yet sent to `seconds` later, when the clock has run away."""
        self._epoch += seconds

    # Sessions

    def create_session(self, session_id: str | None, now: float) -> SessionInfo:
        """Raises InvalidArgument, AlreadyExists, ResourceExhausted."""
        if session_id is not None:
            check_session_id(session_id)
        return self.get_session(self._registry.add_session(session_id, now).session_id)

    def get_session(self, session_id: str) -> SessionInfo:
        """Raises NotFound."""
        session = self._registry.session(session_id)
        return SessionInfo(session.session_id, tuple(session.agents), session.created_at)

    def delete_session(self, session_id: str) -> None:
        """End a session and its agents. Raises NotFound."""
        for agent_id in self.get_session(session_id).agent_ids:
            self.delete_agent(agent_id)
        del self._registry.sessions[session_id]

    # Agents

    def prepare(self, specs: Sequence[AgentSpec]) -> list[Motion]:
        """Standing seeds for `create_agents`: its costly part, free of state and thread-safe.

        Raises InvalidArgument, ResourceExhausted.
        """
        most = self.settings.limits.agents_per_session
        if len(specs) > most:
            raise ResourceExhausted(f"{len(specs)} agents at once; allowed per session: {most}")
        for number, spec in enumerate(specs):
            check_spec(spec, f"agents[{number}]")
        return [self._spawner.stand(spec) for spec in specs]

    def create_agents(
        self,
        session_id: str,
        specs: Sequence[AgentSpec],
        now: float,
        seeds: Sequence[Motion] | None = None,
    ) -> list[AgentInfo]:
        """All or none. `seeds` are what `prepare(specs)` returned, if it has been called.

        Raises NotFound, InvalidArgument, ResourceExhausted.
        """
        session = self._registry.session(session_id)
        seeds = self.prepare(specs) if seeds is None else seeds
        self._registry.check_room(session, len(specs))
        pairs = zip(specs, seeds, strict=True)
        return [self._info(self._add_agent(session, spec, seed, now)) for spec, seed in pairs]

    def get_agent(self, agent_id: str) -> AgentInfo:
        """Raises NotFound."""
        return self._info(self._registry.agent(agent_id))

    def list_agents(self, session_id: str) -> list[AgentInfo]:
        """In order of creation. Raises NotFound."""
        return [self._info(agent) for agent in self._registry.session(session_id).agents.values()]

    def session_of(self, agent_id: str) -> str:
        """Id of an agent's session. Raises NotFound."""
        return self._registry.agent(agent_id).session_id

    def delete_agent(self, agent_id: str) -> None:
        """Its planned frames are thrown away. Raises NotFound."""
        agent = self._registry.agent(agent_id)
        slots = self._table.rows
        phase = slots.start_frame[agent.slot] % NEW_FRAMES // self._phase_frames
        self._phase_load[phase, slots.gender[agent.slot]] -= 1
        self._table.release(agent.slot)
        self._registry.remove_agent(agent)

    # Goals

    def set_goal(self, agent_id: str, goal: Goal, now: float) -> int:
        """Replan for a new goal; return its revision. Raises NotFound, InvalidArgument."""
        agent = self._registry.agent(agent_id)
        check_goal(goal, self._info(agent).position, self.settings.limits)
        return self._walk(agent, (goal,), now)

    def set_path(self, agent_id: str, goals: Sequence[Goal], now: float) -> int:
        """Replan for goals to be visited in turn; return the revision, one for all of them.

        A goal to pass through is done with once it is reached, another one after the agent has
        stood there for its dwell. Raises NotFound, InvalidArgument.
        """
        agent = self._registry.agent(agent_id)
        check_path(goals, self._info(agent).position, self.settings.limits)
        return self._walk(agent, tuple(goals), now)

    def clear_goal(self, agent_id: str, now: float) -> int:
        """Stop where the agent is; return the new revision. Raises NotFound."""
        agent = self._registry.agent(agent_id)
        self._replan(agent, now)
        return self._revise(agent, ())

    # Counts

    @property
    def agents(self) -> int:
        """Agents of all sessions."""
        return len(self._registry.agents)

    @property
    def sessions(self) -> int:
        """Open sessions."""
        return len(self._registry.sessions)

    @property
    def resets(self) -> int:
        """How often an agent had to be put back to a stand because its step was broken."""
        return self._scheduler.resets

    @property
    def reduced_steps(self) -> int:
        """Agent steps for which time was too short to try all the candidates wished for."""
        return self._scheduler.reduced_steps

    # Within

    def _frame(self, time: float) -> float:
        """World frame shown at `time`; the small term absorbs rounding of Unix seconds."""
        return (time - self._epoch) * FPS + 1e-3

    def _time(self, frame: int) -> float:
        return self._epoch + frame / FPS

    @property
    def _phase_frames(self) -> int:
        return NEW_FRAMES // self.settings.phases

    def _start_frame(self, gender: int, now: float) -> int:
        """First frame of a new agent, as soon as it can be planned in its phase.

        The phase is one of the emptiest, and there one with many of its gender: they share calls.
        """
        load = self._phase_load
        phase = int(np.lexsort([-load[:, gender], load.sum(axis=1)])[0])
        load[phase, gender] += 1
        earliest = ceil(self._frame(now)) + self.settings.lead * NEW_FRAMES
        return earliest + (phase * self._phase_frames - earliest) % NEW_FRAMES

    def _add_agent(self, session: Session, spec: AgentSpec, seed: Motion, now: float) -> Agent:
        slot = self._table.acquire()
        slots, row = self._table.rows, np.array([slot])
        slots.gender[slot] = gender = GENDERS.index(spec.gender)
        slots.noise_seed[slot] = spec.noise_seed
        slots.betas[slot] = spec.betas
        slots.foot_lock[slot] = spec.foot_lock
        slots.legs.put(row, measure_legs(self._bodies[spec.gender], np.array(spec.betas)))
        self._paths.put(slot, (), spec.position)
        slots.committed.put(row, seed)
        slots.planned.put(row, seed)
        slots.start_frame[slot] = self._start_frame(gender, now)
        return self._registry.add_agent(session, spec, slot, now)

    def _replan(self, agent: Agent, now: float) -> None:
        # What falls due within the margin could not be made again in time.
        self._playback.replan(agent.slot, self._frame(now + self.settings.replan_margin))

    def _walk(self, agent: Agent, goals: tuple[Goal, ...], now: float) -> int:
        self._replan(agent, now)
        self._table.rows.planned.gait.mode[agent.slot] = Mode.WALKING
        return self._revise(agent, goals)

    def _revise(self, agent: Agent, goals: tuple[Goal, ...]) -> int:
        agent.path = goals
        slots, slot = self._table.rows, agent.slot
        x, y = slots.planned.seed.translation[slot, -1, :2].tolist()
        self._paths.put(slot, goals, (x, y))
        slots.planned.gait.arrived[slot] = False
        slots.planned.gait.waypoint[slot] = 0
        slots.goal_revision[slot] += 1
        return int(slots.goal_revision[slot])

    def _stand_again(self, slot: int) -> Motion:
        seed, spec = self._table.rows.planned.seed, self._registry.by_slot[slot].spec
        x, y, _ = (float(v) for v in seed.translation[slot, -1])
        heading = heading_of(seed.rotations[slot, -1, 0])
        return self._spawner.stand(replace(spec, position=(x, y), heading=heading))

    def _info(self, agent: Agent) -> AgentInfo:
        return agent_info(agent, self._table.rows)
