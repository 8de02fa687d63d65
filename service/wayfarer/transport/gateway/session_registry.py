"""The transport's record of each session: owner, basis, lease."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final

import structlog

from wayfarer.config.limits import Limits
from wayfarer.errors import ResourceExhausted, WayfarerError
from wayfarer.transport import schema
from wayfarer.transport.conversion import convert
from wayfarer.transport.edge.caller import Caller
from wayfarer.transport.gateway.leases import Leased, Leases, counted
from wayfarer.transport.gateway.session_locator import SessionLocator
from wayfarer.transport.streams.stream import MotionStream
from wayfarer.world.agents.agent import AgentInfo, SessionInfo

LEASE_S: Final = 60.0
"""Lease of a session whose request names none."""

MAX_DELETIONS: Final = 1024
"""A resumed stream receives deletions among this many newest agents of its session."""


@dataclass(eq=False)
class StreamPlace:
    """A stream of a session, counted before it is open."""

    caller: Caller
    stream: MotionStream | None = None


@dataclass
class OpenSession(Leased):
    """A session of the runtime, as its clients see it."""

    info: SessionInfo
    drawn: int = 0  # number of seeds drawn for agents, including those being created
    last_alias: int = 0  # the greatest that the runtime has reported
    aliases: dict[str, int] = field(default_factory=dict)  # by agent id, without a crowd's people
    crowd: int = 0  # people who were requested; they come and go without a call
    places: set[StreamPlace] = field(default_factory=set)  # its streams
    holders: int = 0  # streams and long calls that keep it alive

    @property
    def session_id(self) -> str:
        """Unique on the server."""
        return self.info.session_id

    @property
    def scene(self) -> str:
        """Id of the scene that it is in; empty for the flat floor."""
        return self.info.spec.scene

    def gone(self, agents: Sequence[AgentInfo] = ()) -> list[int]:
        """Aliases of the agents that were deleted last.

        `agents`: all that it has now, needed if some come without a call.
        """
        living = {*self.aliases.values(), *(agent.alias for agent in agents)}
        self.last_alias = max((self.last_alias, *living))
        first = max(self.last_alias - MAX_DELETIONS, 0) + 1
        return [alias for alias in range(first, self.last_alias + 1) if alias not in living]

    def describe(self, info: SessionInfo) -> schema.Session:
        """Describes it for its client; `info` is its present state in the runtime."""
        return schema.Session(
            session_id=info.session_id,
            basis=convert.basis_info(self.basis),
            agent_ids=info.agent_ids,
            created_at_us=convert.microseconds(info.created_at),
            seed=info.spec.seed,
            lease_s=self.lease_s,
            expires_at_us=convert.microseconds(self.expires_at),
            lock_step=info.spec.lock_step,
            record=info.spec.record,
            scene=self.scene,
            avoid=info.spec.avoid,
            endpoint=self.endpoint,
        )


class SessionRegistry(Leases[OpenSession]):
    """All open sessions, and the rights of callers to them."""

    def __init__(
        self, limits: Limits, clock: Callable[[], float], locator: SessionLocator | None = None
    ) -> None:
        super().__init__("session", limits, clock, locator or SessionLocator())
        self._by_agent: dict[str, OpenSession] = {}
        self._coming_agents: Counter[str] = Counter()  # by caller, being created

    def open(self, info: SessionInfo, agents: Sequence[AgentInfo] = ()) -> OpenSession:
        """Enters a session of the runtime by its attributes, with a fresh lease.

        Raises InvalidArgument if the attributes were not made by the transport.
        """
        lease = self._lease(info.spec.attributes)
        self.close(info.session_id)  # a session that has just ended may still be registered
        session = OpenSession(**vars(lease), info=info)
        self._open[info.session_id] = session
        self.enter_agents(session, agents)
        return session

    @property
    def live(self) -> int:
        """Number of sessions that are not in lock-step."""
        return sum(not session.info.spec.lock_step for session in self._open.values())

    def scene_of(self, session_id: str) -> str | None:
        """Id of a session's scene, empty for the flat floor; None for an unknown session."""
        found = self._open.get(session_id)
        return None if found is None else found.scene

    def close(self, name: str, one: OpenSession | None = None) -> OpenSession | None:
        """Ends a session's lease, and forgets its agents."""
        closed = super().close(name, one)
        for agent_id in closed.aliases if closed else ():
            del self._by_agent[agent_id]
        return closed

    def enter_agents(self, session: OpenSession, agents: Sequence[AgentInfo]) -> None:
        """Remembers the agents of a session, unless it has ended meanwhile."""
        for agent in agents if self._is_open(session) else ():
            session.aliases[agent.agent_id] = agent.alias
            session.last_alias = max(session.last_alias, agent.alias)
            session.drawn = max(session.drawn, agent.alias)  # aliases count from 1
            self._by_agent[agent.agent_id] = session

    def remove_agent(self, session: OpenSession, agent_id: str, alias: int) -> None:
        """Forgets an agent and reports it to the session's streams. Safe to call twice."""
        if session.aliases.pop(agent_id, None) is not None:
            self._by_agent.pop(agent_id, None)
        for place in session.places:
            if place.stream is not None:
                place.stream.remove(alias)

    def session(self, session_id: str) -> OpenSession:
        """Returns a session of the present caller and renews its lease.

        Raises NotFound, Misdirected, Unavailable.
        """
        return self._renewed(self._open.get(session_id), "session", session_id)

    def session_of(self, agent_id: str) -> OpenSession:
        """Returns the session of an agent, if it is the present caller's, and renews its lease.

        Raises NotFound, Misdirected, Unavailable.
        """
        return self._renewed(self._by_agent.get(agent_id), "agent", agent_id)

    def expired(self) -> list[OpenSession]:
        """Sessions whose lease has expired. A stream keeps its session's lease."""
        if not self._locator.holds:  # another node may have adopted them
            return []
        for session in self._open.values():
            if session.holders:
                self.renew(session)
        return super().expired()

    @contextmanager
    def session_room(self, caller: Caller) -> Iterator[None]:
        """Reserves room for a session until it is entered. Raises ResourceExhausted."""
        own = sum(s.owner == caller.name for s in self._open.values())
        has, most = own + self._coming[caller.name], caller.quota.sessions
        most = self._limits.sessions_per_caller if most is None else most
        if has >= most:
            raise ResourceExhausted(
                f"{caller.name!r} has {has} sessions and may have {most}; delete one first"
            )
        with counted(self._coming, caller.name):
            yield

    @contextmanager
    def agent_room(self, caller: Caller, more: int) -> Iterator[None]:
        """Reserves room for agents until they are entered. A crowd counts with its requested size.
        Raises ResourceExhausted.
        """
        own = [s for s in self._open.values() if s.owner == caller.name]
        has, most = self._coming_agents[caller.name], caller.quota.agents
        has += sum(len(s.aliases) + s.crowd for s in own)
        if most is not None and more > 0 and has + more > most:
            raise ResourceExhausted(
                f"{caller.name!r} has {has} agents and may have {most}; {more} more were asked for"
            )
        with counted(self._coming_agents, caller.name, more):
            yield

    @contextmanager
    def held(self, session: OpenSession) -> Iterator[None]:
        """Keeps the lease from expiring; it restarts afterwards."""
        session.holders += 1
        try:
            yield
        finally:
            session.holders -= 1
            self.renew(session)

    @contextmanager
    def place(self, caller: Caller, session: OpenSession) -> Iterator[StreamPlace]:
        """Reserves room for a stream, which keeps the session's lease. Raises ResourceExhausted."""
        limits, quota = self._limits, caller.quota.streams
        if len(session.places) >= limits.streams_per_session:
            raise ResourceExhausted(
                f"a session has {limits.streams_per_session} streams at most", 1.0
            )
        callers = [place.caller.name for s in self._open.values() for place in s.places]
        if len(callers) >= limits.streams:
            raise ResourceExhausted(f"the server has {limits.streams} streams at most", 5.0)
        if quota is not None and callers.count(caller.name) >= quota:
            raise ResourceExhausted(f"{caller.name!r} may have {quota} streams at a time", 1.0)
        place = StreamPlace(caller)
        session.places.add(place)
        try:
            with self.held(session):
                yield place
        finally:
            session.places.discard(place)

    def end_streams(self, error: WayfarerError, of: Callable[[Caller], bool]) -> int:
        """Ends the streams of some callers; returns how many were not ending already."""
        return sum(
            place.stream.end(error)
            for session in self._open.values()
            for place in session.places
            if place.stream is not None and of(place.caller)
        )

    @property
    def streams(self) -> int:
        """Number of open streams."""
        return sum(len(session.places) for session in self._open.values())

    def _is_open(self, session: OpenSession) -> bool:
        return self._open.get(session.session_id) is session

    def _is_over(self, one: OpenSession) -> bool:
        return one.expires_at < self._clock() and not one.holders

    def _renewed(self, found: OpenSession | None, kind: str, name: str) -> OpenSession:
        session = self._checked(found, kind, name)
        self._locator.require_lease()
        structlog.contextvars.bind_contextvars(session_id=session.session_id)
        self.renew(session)
        return session
