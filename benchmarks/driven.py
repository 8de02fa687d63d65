"""A service with a manual clock and an engine that computes nothing."""

import argparse
import asyncio
import time
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Final

import numpy as np

from wayfarer.body.library import SHIPPED, load_body
from wayfarer.config.limits import Limits
from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.models.bundle import START_POSES
from wayfarer.runtime.stats import LoopStats
from wayfarer.runtime.streams.publications import StreamOptions
from wayfarer.runtime.streams.publisher import Publisher
from wayfarer.runtime.streams.subscription import Subscription
from wayfarer.spec import GENDERS, NEW_FRAMES, SEED_FRAMES
from wayfarer.terms import TERMS
from wayfarer.transport.edge.metrics import Metrics
from wayfarer.world.agents.agent import AgentInfo, AgentSpec, SessionInfo, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.spawn import load_start_poses
from wayfarer.world.goals.steering import Steering
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.stepping.due import sights_of
from wayfarer.world.stepping.settings import AdmissionRules, WorldSettings
from wayfarer.world.world import World


class InstantEngine:
    """Moves all agents one way without computing anything: `stride` metres a step."""

    stride = 0.2
    name = "instant"
    graphs = ("0" * 64, "1" * 64)
    term_names = TERMS

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        """Implements `Engine`."""
        agents = len(inputs.goal)
        move = np.linspace(0, self.stride, NEW_FRAMES + 1, dtype=np.float32)[None, 1:, None]
        return StepOutputs(
            translation=inputs.seed_translation[:, -1:] + move,
            rotations=np.repeat(inputs.seed_rotations[:, -1:], NEW_FRAMES, axis=1),
            contacts=np.ones((agents, NEW_FRAMES, 2), np.float32),
            next_seed_markers=inputs.seed_markers + move[:, -SEED_FRAMES:, None],
            terms=np.zeros((agents, len(TERMS)), np.float32),
            choice=np.zeros(agents, np.int64),
        )

    @property
    def single_threaded(self) -> "InstantEngine":
        """Implements `Engine`."""
        return self

    scoring = single_threaded


FAR: Final = Goal((9_000.0, 0.0, 0.0))
PAUSE: Final = 0.01
"""Seconds for the event loop to send, after each moment at which something happens."""


class Driven:
    """The part of `MotionService` that streams need, with a clock driven by hand."""

    ready = alive = True

    def __init__(self, asked: argparse.Namespace, engine: InstantEngine | None = None) -> None:
        sizes = tuple(2**power for power in range(16) if 2**power <= asked.batch)
        settings = WorldSettings(
            limits=Limits(
                agents=asked.agents,
                agents_per_session=asked.agents,
                sessions=asked.sessions,
                goal_distance_m=20_000.0,
            ).model_copy(update={"queue_s": 1e6}),  # no reader is too slow here,
            steering=Steering().with_search(candidates=asked.candidates),
            admission=AdmissionRules(refuse=False),
            batch_sizes=sizes,
            phases=asked.phases,
        )
        bodies = {gender: load_body(SHIPPED, gender, "low") for gender in GENDERS}
        self.now = 0.0
        self._meter = Metrics()
        self._world = World(
            engine or InstantEngine(), bodies, load_start_poses(START_POSES), settings
        )
        self._publisher = Publisher(
            settings.limits, self._meter, self._world.get_agent, self._world.faults
        )
        self.scenes = SimpleNamespace(registry=SceneRegistry())  # there are none
        self.subscriptions: list[Subscription] = []

    async def create_session(self, spec: SessionSpec) -> SessionInfo:
        """Implements `MotionService`, as do the methods below."""
        return self._world.create_session(spec, self.now)

    async def create_agents(
        self, session_id: str, specs: Sequence[AgentSpec], names: Sequence[str] = ()
    ) -> list[AgentInfo]:
        """Implements `MotionService`. The agents walk away at once."""
        made = self._world.create_agents(session_id, specs, self.now, names=names)
        for agent in made:
            self._world.give(agent.agent_id, FAR, self.now)
        return made

    async def list_agents(self, session_id: str) -> list[AgentInfo]:
        """Implements `MotionService`."""
        return self._world.list_agents(session_id)

    async def get_agent(self, agent_id: str) -> AgentInfo:
        """Implements `MotionService`."""
        return self._world.get_agent(agent_id)

    async def list_sessions(self) -> list[SessionInfo]:
        """Implements `MotionService`."""
        return self._world.list_sessions()

    async def subscribe(self, session_id: str, options: StreamOptions) -> Subscription:
        """Implements `MotionService`."""
        made = Subscription(
            session_id, options, self._world.settings.limits, self._meter, lambda: self.now
        )
        self._publisher.subscribe(made, self.now)
        self.subscriptions.append(made)
        return made

    async def stats(self) -> LoopStats:
        """Implements `MotionService`."""
        return LoopStats(0, 0, 0, 0, 0.0, 0.0, 0, 0.0, 0.0)

    async def advance(self, seconds: float) -> float:
        """Advances time; returns the CPU seconds that a motion thread would have used."""
        until, spent = self.now + seconds, 0.0
        while (event := self._world.next_event()) is not None and event <= until:
            self.now = event
            started = time.thread_time()
            sent = self._world.take_due(event)
            sights = sights_of(sent, self._world.slots)
            for session_id, chunks, slots in sent:
                self._publisher.publish(session_id, chunks)
                self._world.see(session_id, slots, self._publisher.sights(session_id, chunks))
            if sent:
                due = np.concatenate([one.chunks.scheduled_at for one in sent])
                self._meter.chunks(event - due, sights)
            self._publisher.flush()
            while self._world.step(event):
                pass
            spent += time.thread_time() - started
            await asyncio.sleep(PAUSE)
        self.now = until
        return spent
