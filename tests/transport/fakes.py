"""An in-memory MotionService whose motion is made by hand, and a gateway over it."""

import asyncio
from collections.abc import AsyncGenerator, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import count
from typing import Any

import numpy as np

from tests.transport.fake_scenes import FakeScenes
from tests.transport.samples import MODEL, NOW, agent_info, chunk
from tests.world.fakes import ManualClock
from wayfarer.config.limits import Limits
from wayfarer.engines.models import ModelInfo
from wayfarer.errors import (
    Aborted,
    AlreadyExists,
    ArtifactError,
    FailedPrecondition,
    InvalidArgument,
    NotFound,
    Unavailable,
    WayfarerError,
)
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.stats import LoopStats
from wayfarer.runtime.streams.publications import Publication, StreamOptions
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.gateway import Gateway
from wayfarer.world.agents.agent import (
    NO_CHUNKS,
    AgentChange,
    AgentInfo,
    AgentSpec,
    MotionChunk,
    MotionChunks,
    SessionInfo,
    SessionSpec,
)
from wayfarer.world.agents.goal import Goal
from wayfarer.world.events import Event
from wayfarer.world.goals.commands import GoalCommand


class FakeSubscription:
    epoch = "epoch-1"

    def __init__(self, session_id: str, options: StreamOptions) -> None:
        self.session_id = session_id
        self.options = options
        self.agent_ids = set(options.agent_ids)
        self.resumed = options.resume is not None and options.resume.epoch == self.epoch
        self.acks: list[tuple[int, float]] = []
        self.meter = MetricsSink()
        self.queue: asyncio.Queue[Publication | WayfarerError | None] = asyncio.Queue()
        self.closed = False

    def __aiter__(self):
        return self

    async def __anext__(self) -> Publication:
        item = await self.queue.get()
        if item is None:
            raise StopAsyncIteration
        if isinstance(item, WayfarerError):
            raise item
        return item

    def ack(self, position: int, playhead: float) -> None:
        self.acks.append((position, playhead))

    def end(self) -> None:
        self.queue.put_nowait(None)

    async def close(self) -> None:
        self.closed = True


class FakeService(FakeScenes):
    """Agents stand where they were put; `emit` sends a chunk of each."""

    def __init__(self) -> None:
        super().__init__()
        self.ready = True
        self.alive = True
        self.specs: list[AgentSpec] = []
        self.commands: list[tuple[str, GoalCommand]] = []
        self.expected: list[int | None] = []
        self.subscriptions: list[FakeSubscription] = []
        self.models = [MODEL]
        self.created = 0  # sessions and agents ever
        self.fail_with: Exception | None = None  # the next command fails with it
        self.slow: asyncio.Event | None = None  # creations wait for it
        self._infos: dict[str, SessionInfo] = {}
        self._sessions: dict[str, list[AgentInfo]] = {}
        self._published: dict[str, list[Publication]] = {}
        self._seq: dict[str, int] = {}
        self._alias: dict[str, int] = {}
        self._number = count(1)

    @property
    def scenes(self) -> FakeScenes:
        return self

    def _session(self, session_id: str) -> list[AgentInfo]:
        if self.fail_with is not None:
            error, self.fail_with = self.fail_with, None
            raise error
        if session_id not in self._sessions:
            raise NotFound(f"no session {session_id!r}")
        return self._sessions[session_id]

    def _agent(self, agent_id: str) -> AgentInfo:
        for agents in self._sessions.values():
            for agent in agents:
                if agent.agent_id == agent_id:
                    return agent
        raise NotFound(f"no agent {agent_id!r}")

    async def create_session(self, spec: SessionSpec) -> SessionInfo:
        self.created += 1
        if self.slow is not None:
            await self.slow.wait()
        session_id = spec.session_id or f"session-{next(self._number)}"
        self._infos[session_id] = SessionInfo(session_id, (), NOW, spec)
        if spec.scene:
            self.registry.enter(spec.scene, session_id)
        self._sessions[session_id] = []
        self._published[session_id] = []
        return await self.get_session(session_id)

    async def get_session(self, session_id: str) -> SessionInfo:
        agents = self._session(session_id)
        return replace(self._infos[session_id], agent_ids=tuple(a.agent_id for a in agents))

    async def list_sessions(self) -> list[SessionInfo]:
        return [await self.get_session(session_id) for session_id in self._sessions]

    async def delete_session(self, session_id: str) -> None:
        self._session(session_id)
        del self._sessions[session_id]
        if scene := self._infos[session_id].spec.scene:
            self.registry.leave(scene, session_id)
        for subscription in self.subscriptions:
            if subscription.session_id == session_id:
                subscription.queue.put_nowait(None)

    async def create_agents(
        self, session_id: str, specs: Sequence[AgentSpec], names: Sequence[str] = ()
    ) -> list[AgentInfo]:
        agents = self._session(session_id)
        self.created += len(specs)
        if self.slow is not None:
            await self.slow.wait()
        self.specs += specs
        first = self._alias.get(session_id, 0) + 1
        self._alias[session_id] = first - 1 + len(specs)
        made = [
            agent_info(
                names[i] if names else f"agent-{next(self._number)}", first + i, session_id, spec
            )
            for i, spec in enumerate(specs)
        ]
        agents += made
        return made

    async def get_agent(self, agent_id: str) -> AgentInfo:
        return self._agent(agent_id)

    async def list_agents(self, session_id: str) -> list[AgentInfo]:
        return list(self._session(session_id))

    async def update_agent(self, agent_id: str, change: AgentChange) -> AgentInfo:
        agent = self._agent(agent_id)
        changes = {k: v for k, v in asdict(change).items() if v is not None}
        changed = replace(agent, spec=replace(agent.spec, **changes))
        agents = self._sessions[agent.session_id]
        agents[agents.index(agent)] = changed
        return changed

    async def delete_agent(self, agent_id: str) -> None:
        agent = self._agent(agent_id)
        self._sessions[agent.session_id].remove(agent)

    async def give(self, agent_id: str, command: GoalCommand, expected: int | None = None) -> int:
        """The revision is the number of commands ever given."""
        self._agent(agent_id)
        if expected is not None and expected != len(self.commands):
            raise Aborted(f"revision {expected} is stale; it is {len(self.commands)}")
        self.expected.append(expected)
        self.commands.append((agent_id, command))
        return len(self.commands)

    async def subscribe(self, session_id: str, options: StreamOptions) -> FakeSubscription:
        known = {agent.agent_id for agent in self._session(session_id)}
        if self._infos[session_id].spec.lock_step:
            raise FailedPrecondition("a lock-step session has no streams")
        if unknown := set(options.agent_ids) - known:
            raise NotFound(f"no agents {sorted(unknown)}")
        subscription = FakeSubscription(session_id, options)
        self.subscriptions.append(subscription)
        if subscription.resumed:
            for published in self._published[session_id][options.resume.position :]:
                subscription.queue.put_nowait(published)
        return subscription

    async def step_session(self, session_id: str, steps: int) -> list[Publication]:
        self._session(session_id)
        if not self._infos[session_id].spec.lock_step:
            raise FailedPrecondition(f"session {session_id!r} is not in lock-step")
        return [self._publish(session_id, ()) for _ in range(steps)]

    async def export_session(self, session_id: str) -> bytes:
        self._session(session_id)
        return kept((self._infos[session_id], self._sessions[session_id]))

    async def import_session(
        self, snapshot: bytes, attributes: Mapping[str, str] | None = None
    ) -> SessionInfo:
        try:
            info, agents = found(snapshot)
        except ValueError:
            raise InvalidArgument("not a snapshot", "snapshot") from None
        if info.session_id in self._sessions:
            raise AlreadyExists(f"session {info.session_id!r} is here")
        spec = replace(info.spec, attributes={**info.spec.attributes, **(attributes or {})})
        self._infos[info.session_id] = replace(info, spec=spec)
        self._sessions[info.session_id] = agents
        self._published[info.session_id] = []
        return await self.get_session(info.session_id)

    async def export_log(self, session_id: str) -> bytes:
        self._session(session_id)
        if not self._infos[session_id].spec.record:
            raise FailedPrecondition(f"session {session_id!r} is not recorded")
        return b"log of " + session_id.encode()

    async def replay(self, log: bytes) -> AsyncGenerator[Publication]:
        if not log.startswith(b"log of "):
            raise InvalidArgument("not a log", "log")
        for published in self._offline(AgentSpec(), 2):
            yield published

    async def generate_clip(
        self, spec: AgentSpec, goals: Sequence[Goal], seconds: float, until_arrival: bool
    ) -> AsyncGenerator[Publication]:
        self.specs.append(spec)
        for published in self._offline(spec, round(seconds / 0.2)):
            if self.fail_with is not None and published.position > 1:
                raise self.fail_with
            yield published

    def _offline(self, spec: AgentSpec, steps: int) -> Iterator[Publication]:
        info = agent_info("agent-1", 1, "", spec)
        for seq in range(steps):
            made = chunk("agent-1", 1, seq, info.position)
            yield Publication(seq + 1, MotionChunks.of([made]), added=() if seq else (info,))

    async def list_models(self) -> list[ModelInfo]:
        return list(self.models)

    async def load_model(self, name: str) -> None:
        if name == "broken":
            raise ArtifactError("its hash is wrong")
        if name == "none":
            raise NotFound(f"no model {name!r}")
        if any(model.name == name for model in self.models):
            raise AlreadyExists(f"model {name!r} is loaded")
        self.models.append(replace(MODEL, name=name, in_use=False))

    async def use_model(self, name: str, move_agents: bool) -> int:
        if all(model.name != name for model in self.models):
            raise NotFound(f"no model {name!r}")
        self.models = [replace(model, in_use=model.name == name) for model in self.models]
        return sum(map(len, self._sessions.values())) if move_agents else 0

    async def unload_model(self, name: str) -> None:
        if all(model.name != name for model in self.models):
            raise NotFound(f"no model {name!r}")
        if any(model.name == name and model.in_use for model in self.models):
            raise FailedPrecondition(f"model {name!r} is in use")
        self.models = [model for model in self.models if model.name != name]

    async def stats(self) -> LoopStats:
        return LoopStats(1, 1, 1, 10, 2.5, 3.0, 0, 0.1, 12.0)

    def emit(self, session_id: str, *events: Event) -> tuple[MotionChunk, ...]:
        """One chunk of each agent of a session, to every subscription of it."""
        published = self._publish(session_id, events)
        for subscription in self.subscriptions:
            names, wanted = published.chunks.agent_id, subscription.agent_ids
            rows = [i for i, name in enumerate(names) if not wanted or name in wanted]
            if subscription.session_id == session_id and not subscription.closed:
                chunks = published.chunks.take(np.array(rows, np.int64))
                subscription.queue.put_nowait(replace(published, chunks=chunks))
        return tuple(published.chunks)

    def _publish(self, session_id: str, events: Sequence[Event]) -> Publication:
        chunks = []
        for agent in self._sessions[session_id]:
            seq = self._seq.get(agent.agent_id, 0)
            self._seq[agent.agent_id] = seq + 1
            chunks.append(chunk(agent.agent_id, agent.alias, seq, agent.position))
        past = self._published[session_id]
        columns = MotionChunks.of(chunks) if chunks else NO_CHUNKS
        past.append(Publication(len(past) + 1, columns, tuple(events)))
        return past[-1]

    def break_down(self) -> None:
        """Fails like a motion loop that ends with an error."""
        self.ready = self.alive = False
        for subscription in self.subscriptions:
            subscription.queue.put_nowait(Unavailable("the motion loop has failed"))


def kept(value: Any) -> bytes:
    """A stand-in for a snapshot: this process keeps the value, the bytes are its number."""
    KEPT.append(value)
    return b"snapshot %d" % (len(KEPT) - 1)


def found(snapshot: bytes) -> Any:
    return KEPT[int(snapshot.removeprefix(b"snapshot "))]


KEPT: list[Any] = []


def gateway(
    service: FakeService | None = None,
    limits: Limits | None = None,
    clock: ManualClock | None = None,
) -> Gateway:
    """A gateway that does not accept work before `await api.take_over()`."""
    return Gateway(
        service or FakeService(),
        BodyLibrary("anny52"),
        limits or Limits(),
        clock or ManualClock(NOW),
        lambda: None,
    )


async def opened(
    service: FakeService | None = None,
    limits: Limits | None = None,
    clock: ManualClock | None = None,
) -> Gateway:
    """A gateway that accepts work."""
    api = gateway(service, limits, clock)
    await api.take_over()
    return api
