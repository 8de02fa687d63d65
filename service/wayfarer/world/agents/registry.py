"""Sessions and their agents by id, by slot, and by alias."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from wayfarer.config.limits import Limits
from wayfarer.errors import AlreadyExists, NotFound, ResourceExhausted
from wayfarer.ids import agent_id, group_of
from wayfarer.ids import session_id as new_session_id
from wayfarer.world.agents.agent import AgentSpec, SessionInfo, SessionSpec
from wayfarer.world.agents.behaviour import Agent
from wayfarer.world.agents.reservations import Reservation


@dataclass(slots=True)
class Session:
    """A session and its agents in order of creation. Aliases count from 1; none is used twice."""

    session_id: str
    number: int  # never used twice by a world
    created_at: float
    spec: SessionSpec
    agents: dict[str, Agent] = field(default_factory=dict)
    last_alias: int = 0
    scene: int = 0  # number of its scene in this world; 0: none
    frozen: bool = False  # it is moving to another server

    def info(self) -> SessionInfo:
        """Its description for callers."""
        return SessionInfo(self.session_id, tuple(self.agents), self.created_at, self.spec)


class Registry:
    """The sessions and agents of a world."""

    def __init__(self, limits: Limits, new_group: Callable[[], str]) -> None:
        """`new_group()` returns the group of a new session's id."""
        self._limits = limits
        self._new_group = new_group
        self.sessions: dict[str, Session] = {}
        self._last_number = 0
        self.agents: dict[str, Agent] = {}
        self.by_slot: dict[int, Agent] = {}

    def session(self, session_id: str) -> Session:
        """Raises NotFound."""
        try:
            return self.sessions[session_id]
        except KeyError:
            raise NotFound(f"no session {session_id!r}") from None

    def agent(self, agent_id: str) -> Agent:
        """Raises NotFound."""
        try:
            return self.agents[agent_id]
        except KeyError:
            raise NotFound(f"no agent {agent_id!r}") from None

    def add_session(self, spec: SessionSpec, now: float, admit: bool = True) -> Session:
        """Adds a session; with `admit` false even beyond the limit.

        Raises AlreadyExists, ResourceExhausted.
        """
        # in the scene's group, since one node has a scene and all of its sessions
        session_id = spec.session_id or new_session_id(
            group_of(spec.scene) if spec.scene else self._new_group()
        )
        if session_id in self.sessions:
            raise AlreadyExists(f"session {session_id!r} exists already")
        if admit and len(self.sessions) >= self._limits.sessions:
            raise ResourceExhausted(
                f"all {self._limits.sessions} sessions are open; delete one first"
            )
        self._last_number += 1
        self.sessions[session_id] = session = Session(session_id, self._last_number, now, spec)
        return session

    def check_room(self, wanted: Reservation, held: Sequence[Reservation] = ()) -> None:
        """Checks whether these agents fit in addition to the reservations. Thread-safe.

        Raises NotFound, ResourceExhausted.
        """
        own, all_ = self._limits.agents_per_session, self._limits.agents
        session, more = self.session(wanted.session_id), len(wanted.genders)
        coming = sum(len(h.genders) for h in held if h.session_id == session.session_id)
        if (here := len(session.agents) + coming) + more > own:
            raise ResourceExhausted(
                f"session {session.session_id!r} has {here} agents and may have {own}; "
                f"{more} more were asked for"
            )
        if (here := len(self.agents) + sum(len(h.genders) for h in held)) + more > all_:
            raise ResourceExhausted(
                f"{here} of {all_} agents exist; {more} more were asked for",
                retry_after=5.0 if more <= all_ else 0.0,
            )

    def add_agent(
        self, session: Session, spec: AgentSpec, slot: int, now: float, name: str = ""
    ) -> Agent:
        """Adds a new agent whose slot has been acquired. `name`: its id; empty: a new one."""
        session.last_alias += 1
        name = name or agent_id(session.session_id)
        return self.enter(Agent(name, session.last_alias, session.session_id, spec, slot, now))

    def enter(self, agent: Agent) -> Agent:
        """Adds an agent that has an id. Raises AlreadyExists."""
        name, session = agent.agent_id, self.sessions[agent.session_id]
        if name in self.agents:
            raise AlreadyExists(f"agent {name!r} exists already")
        self.agents[name] = session.agents[name] = self.by_slot[agent.slot] = agent
        return agent

    def remove_agent(self, agent: Agent) -> None:
        """Forgets an agent."""
        del self.agents[agent.agent_id], self.by_slot[agent.slot]
        del self.sessions[agent.session_id].agents[agent.agent_id]
