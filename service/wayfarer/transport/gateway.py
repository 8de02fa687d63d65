"""The API behind both transports: sessions with their bases, limits, conversion, streams.

gRPC and HTTP only translate their own forms into calls of `Gateway`, so both behave alike.
Arguments and results are schema.py's, in the basis of the session.
"""

import asyncio
import contextlib
from collections.abc import AsyncGenerator, Callable, Sequence
from dataclasses import dataclass, field

import structlog

from wayfarer import __version__
from wayfarer.config import Limits
from wayfarer.errors import InvalidArgument, NotFound, ResourceExhausted, Unavailable
from wayfarer.runtime.service import MotionService
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.transport import convert, schema
from wayfarer.transport.basis import Basis
from wayfarer.transport.bodies import BodyLibrary
from wayfarer.transport.codec import PoseEncoder
from wayfarer.transport.stream import MotionStream
from wayfarer.v1 import motion_pb2

log = structlog.get_logger(__name__)

ID_LENGTH = 64


@dataclass
class _Session:
    """What the transport remembers of a session."""

    basis: Basis
    used_at: float  # clock's seconds of the last call or stream
    aliases: dict[str, int] = field(default_factory=dict)  # by agent id
    streams: set[MotionStream] = field(default_factory=set)


class Gateway:
    """One per server. `clock` returns Unix seconds and is the runtime's own."""

    def __init__(
        self,
        service: MotionService,
        bodies: BodyLibrary,
        models: Sequence[schema.Model],
        limits: Limits,
        clock: Callable[[], float],
    ) -> None:
        self.limits = limits
        self.bodies = bodies
        self.skeleton = convert.skeleton()
        self._models = tuple(models)
        self._service = service
        self._clock = clock
        self._encoder = PoseEncoder()
        self._sessions: dict[str, _Session] = {}
        self._owners: dict[str, _Session] = {}  # by agent id: saves a question to the loop
        self._draining = asyncio.Event()

    # life

    @property
    def alive(self) -> bool:
        """The motion loop runs."""
        return self._service.alive

    @property
    def ready(self) -> bool:
        """New work is welcome."""
        return self._service.ready and self._service.alive and not self._draining.is_set()

    async def drain(self, grace: float) -> None:
        """Refuse new work and end all streams with Unavailable; wait for that, `grace` seconds."""
        self._draining.set()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(grace):
                while any(session.streams for session in self._sessions.values()):
                    await asyncio.sleep(0.01)

    async def end_idle_sessions(self) -> list[str]:
        """End the sessions that have had no stream and no call for `session_idle_s`."""
        now, idle = self._clock(), self.limits.session_idle_s
        stale = [
            session_id
            for session_id, session in self._sessions.items()
            if idle and not session.streams and now - session.used_at > idle
        ]
        for session_id in stale:
            log.info("session idle, ended", session_id=session_id, idle_s=idle)
            with contextlib.suppress(NotFound, Unavailable):  # its client or the end was quicker
                await self.delete_session(session_id)
        return stale

    # sessions

    async def create_session(self, wish: schema.NewSession) -> schema.Session:
        """Open a session."""
        self._require_ready()
        info = await self._service.create_session()
        self._sessions[info.session_id] = _Session(wish.basis, self._clock())
        return convert.session(info, wish.basis)

    async def get_session(self, session_id: str) -> schema.Session:
        """Describe a session."""
        session = self._session(session_id)
        return convert.session(await self._service.get_session(session_id), session.basis)

    async def delete_session(self, session_id: str) -> None:
        """End a session, its agents and its streams."""
        session = self._session(session_id)
        del self._sessions[session_id]
        for agent_id in session.aliases:
            del self._owners[agent_id]
        await self._service.delete_session(session_id)

    # agents

    async def create_agents(
        self, session_id: str, specs: Sequence[schema.AgentSpec]
    ) -> tuple[schema.Agent, ...]:
        """Create agents, all or none."""
        self._require_ready()
        session = self._session(session_id)
        if not 1 <= len(specs) <= self.limits.agents_per_call:
            raise InvalidArgument(
                f"1 to {self.limits.agents_per_call} agents per call, not {len(specs)}", "agents"
            )
        wanted = [
            convert.agent_spec(spec, session.basis, self.bodies, f"agents[{i}]")
            for i, spec in enumerate(specs)
        ]
        made = await self._service.create_agents(session_id, wanted)
        for info in made:
            session.aliases[info.agent_id] = info.alias
            self._owners[info.agent_id] = session
        return tuple(convert.agent(info, session.basis, self.bodies) for info in made)

    async def get_agent(self, agent_id: str) -> schema.Agent:
        """Describe one agent."""
        session = self._owner(agent_id)
        info = await self._service.get_agent(agent_id)
        return convert.agent(info, session.basis, self.bodies)

    async def list_agents(self, session_id: str) -> tuple[schema.Agent, ...]:
        """Describe all agents of a session."""
        session = self._session(session_id)
        infos = await self._service.list_agents(session_id)
        return tuple(convert.agent(info, session.basis, self.bodies) for info in infos)

    async def delete_agent(self, agent_id: str) -> None:
        """Remove an agent; the session's streams are told."""
        session = self._owner(agent_id)
        await self._service.delete_agent(agent_id)
        if self._owners.pop(agent_id, None) is not None:
            alias = session.aliases.pop(agent_id)
            for stream in session.streams:
                stream.remove(alias)

    # goals

    async def set_goal(self, agent_id: str, wish: schema.Goal) -> int:
        """Give an agent a goal; return its revision."""
        basis = self._owner(agent_id).basis
        return await self._service.set_goal(agent_id, convert.goal(wish, basis))

    async def set_path(self, agent_id: str, wishes: Sequence[schema.Goal]) -> int:
        """Give an agent goals to visit in turn; return their revision."""
        basis = self._owner(agent_id).basis
        goals = [convert.goal(wish, basis) for wish in wishes]
        return await self._service.set_path(agent_id, goals)

    async def clear_goal(self, agent_id: str) -> int:
        """Stop an agent where it is; return the revision."""
        self._owner(agent_id)
        return await self._service.clear_goal(agent_id)

    # motion

    async def stream(
        self, session_id: str, agent_ids: Sequence[str] = ()
    ) -> AsyncGenerator[motion_pb2.StreamMotionResponse]:
        """Messages of a stream until the session ends. Close it with `aclose`."""
        self._require_ready()
        session = self._session(session_id)
        if len(session.streams) >= self.limits.streams_per_session:
            raise ResourceExhausted(
                f"a session has {self.limits.streams_per_session} streams at most", 1.0
            )
        if sum(len(s.streams) for s in self._sessions.values()) >= self.limits.streams:
            raise ResourceExhausted(f"the server has {self.limits.streams} streams at most", 5.0)
        if len(agent_ids) > self.limits.agents_per_session:
            raise InvalidArgument(f"{self.limits.agents_per_session} at most", "agent_ids")
        stream = MotionStream(
            self._service,
            session_id,
            session.basis,
            self.bodies,
            self.skeleton,
            self._encoder,
            self._clock,
        )
        session.streams.add(stream)  # before the first await: the limits hold
        try:
            async with contextlib.aclosing(stream.messages(agent_ids, self._draining)) as messages:
                async for message in messages:
                    yield message
        finally:
            session.streams.discard(stream)
            session.used_at = self._clock()

    # catalogue

    def list_bodies(self) -> tuple[schema.Body, ...]:
        """The bodies that agents can have."""
        return tuple(convert.body(self.bodies, gender) for gender in schema.Gender)

    def list_models(self) -> tuple[schema.Model, ...]:
        """The motion models that are loaded."""
        return self._models

    def server_info(self) -> schema.ServerInfo:
        """Version, frame rate, limits, bases."""
        return schema.ServerInfo(
            version=__version__,
            fps=FPS,
            frames_per_chunk=NEW_FRAMES,
            limits=self.limits,
            bases=tuple(convert.basis_info(basis) for basis in Basis),
        )

    async def stats(self) -> schema.Stats:
        """Health of the motion loop."""
        return convert.stats(await self._service.stats())

    # inner

    def _require_ready(self) -> None:
        if self._draining.is_set():
            raise Unavailable("the server is shutting down")
        if not self.ready:
            raise Unavailable("the server is not ready yet")

    def _session(self, session_id: str) -> _Session:
        """The session, marked as used."""
        session = self._sessions.get(session_id)
        if session is None:
            raise NotFound(f"there is no session {session_id[:ID_LENGTH]!r}")
        session.used_at = self._clock()
        return session

    def _owner(self, agent_id: str) -> _Session:
        """The session of an agent, marked as used."""
        session = self._owners.get(agent_id)
        if session is None:
            raise NotFound(f"there is no agent {agent_id[:ID_LENGTH]!r}")
        session.used_at = self._clock()
        return session
