"""A service in which one agent of a session fails, or its session; others do not."""

import asyncio
from dataclasses import replace

import numpy as np

from tests.runtime.kept_worlds import fake_worlds, open_journal
from tests.runtime.running import FastTime, until
from tests.world.fakes import FakeEngine, people
from tests.world.scenes.grounds import BOX, FIELD
from wayfarer.navigation.scene_spec import Cylinder, SceneSpec
from wayfarer.runtime.faults import FaultLog
from wayfarer.runtime.motion_service import MotionService
from wayfarer.runtime.streams.publications import StreamOptions
from wayfarer.transport.edge.metrics import Metrics
from wayfarer.world.agents.agent import ChunkFlag, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.events import EventKind
from wayfarer.world.goals.steering import Steering
from wayfarer.world.scenes.messages import SceneSource

GUILTY, MARK = "bad", 2.5
"""The session whose first agent of three has this first beta."""

SOURCE = SceneSource(SceneSpec((FIELD,), (BOX,)))
POST = Cylinder((1.0, 11.0), 0.2, 1.0)


class InjectedError(Exception):
    """The error that a test injects."""


class Rig:
    """A service with a session `bad`, where a stage fails for one agent, and a session `good`."""

    def __init__(self, tmp_path=None, engine=None, **settings):
        self.metrics = Metrics()
        self.engine = engine or MarkedEngine()
        journal = None if tmp_path is None else open_journal(tmp_path / "state")
        settings = {"steering": Steering(reactions=1)} | settings
        worlds = replace(
            fake_worlds(journal, self.engine, **settings), report=FaultLog(self.metrics)
        )
        clock = FastTime()
        self.service = MotionService(worlds, clock=clock, meter=self.metrics)
        clock.drive(self.service._live)
        self.world = self.service._world
        self.unready = 0

    async def __aenter__(self):
        self.service.start()
        await until(lambda: self.service.ready, 20)
        self.scene = (await self.service.scenes.create(SOURCE)).scene_id
        self.watch = asyncio.create_task(self._watch())
        return self

    async def __aexit__(self, *_):
        self.watch.cancel()
        await self.service.stop()

    async def _watch(self):
        while True:
            self.unready += not (self.service.ready and self.service.alive)
            await asyncio.sleep(0.005)

    async def populate(self, record=False):
        spec = SessionSpec(GUILTY, scene="" if record else self.scene, record=record)
        await self.service.create_session(spec)
        await self.service.create_session(SessionSpec("good"))
        specs = [replace(s, position=(2.0 + 2 * i, 2.0)) for i, s in enumerate(people(3))]
        specs[0] = replace(specs[0], betas=(MARK, *specs[0].betas[1:]), gender="female")
        made = await self.service.create_agents(GUILTY, specs)
        self.guilty, *self.fellows = [agent.agent_id for agent in made]
        self.slot = self.world.registry.agents[self.guilty].slot
        elsewhere = [replace(s, position=(50.0 + 2 * i, 0.0)) for i, s in enumerate(people(2))]
        for agent in await self.service.create_agents("good", elsewhere):
            await self.service.give(agent.agent_id, Goal((50.0, 90.0, 0.0)))
        self.good = Reader(await self.service.subscribe("good", StreamOptions()))
        return self

    async def read(self, **options):
        self.bad = Reader(await self.service.subscribe(GUILTY, StreamOptions(**options)))
        await until(lambda: len(self.bad.seqs) == 3 and len(self.good.seqs) == 2, 20)

    def counted(self, name, **labels):
        return self.metrics.registry.get_sample_value(name, labels) or 0

    def faults(self, stage):
        return self.counted("wayfarer_faults_total", stage=str(stage))


class Reader:
    """Reads a stream in the background of the test."""

    def __init__(self, subscription):
        self.subscription = subscription
        self.seqs, self.events, self.states = {}, [], {}
        self.flags = 0
        self.error = None
        self.task = asyncio.create_task(self._read(subscription))

    async def _read(self, subscription):
        try:
            async for publication in subscription:
                for chunk in publication.chunks:
                    assert np.isfinite(chunk.translation).all()
                    assert np.isfinite(chunk.rotations).all()
                    self.seqs.setdefault(chunk.agent_id, []).append(chunk.seq)
                    self.states[chunk.agent_id] = chunk.state
                    self.flags |= int(chunk.flags)
                self.events += publication.events
        except Exception as error:
            self.error = error

    def missed_nothing(self):
        assert self.error is None
        assert not self.flags & ChunkFlag.GAP
        for seqs in self.seqs.values():
            assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))
        return bool(self.seqs)

    def told(self, stage_words=""):
        return [
            e for e in self.events if e.kind is EventKind.FAULT and stage_words in (e.detail or "")
        ]

    async def more(self, count):
        """Wait for `count` more chunks of one agent."""
        before = {name: len(seqs) for name, seqs in self.seqs.items()}
        await until(
            lambda: any(len(s) >= before.get(n, 0) + count for n, s in self.seqs.items()), 20
        )


class MarkedEngine(FakeEngine):
    """Fails for a marked row, or for all, on request."""

    fails = is_down = False

    def step(self, gender, inputs):
        if self.is_down:
            raise InjectedError("the engine is down")
        if self.fails and (inputs.betas[:, 0] == np.float32(MARK)).any():
            raise InjectedError("the engine does not like the row")
        return super().step(gender, inputs)
