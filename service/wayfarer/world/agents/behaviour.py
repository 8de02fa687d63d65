"""Agents and behaviours: what an agent does by itself. The interface that each kind implements.

The kinds are in `behaviours/`, a file each.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot
from typing import ClassVar, Final, Protocol, TypeVar

from wayfarer.limits import Limits
from wayfarer.navigation.scene import Scene
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal

Vector = tuple[float, float]

Start = tuple[float, float, float] | None
"""Where an agent is when it begins, metres; None: not known."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class BodyState:
    """An agent as others see it."""

    place: Vector
    velocity: Vector
    facing: Vector  # unit vector

    @property
    def speed(self) -> float:
        """Metres per second."""
        return hypot(*self.velocity)


@dataclass(frozen=True, slots=True)
class Aim:
    """The present aim of an agent; `place` None: to stand."""

    place: Vector | None
    speed: float = 1.2
    onward: Vector | None = None  # unit vector: it is passed through in that direction
    facing: Vector | None = None  # unit vector to face once there


STAND: Final = Aim(None)


class Others(Protocol):
    """The agents of a session, as a kind of behaviour may look at them."""

    def agent(self, agent_id: str) -> "Agent | None":
        """An agent of the world; None: it has been deleted."""
        ...

    def of_session(self, session_id: str) -> list[str]:
        """Ids of the agents of a session."""
        ...

    def doing(self, agent: "Agent") -> "Behaviour | None":
        """The present behaviour of an agent."""
        ...

    def place(self, agent: "Agent") -> Vector:
        """Where an agent is planned to be."""
        ...


class BehavingAgent(Protocol):
    """The agent that an activity moves, before one of its steps."""

    agent: "Agent"
    others: Others

    @property
    def scene(self) -> Scene | None:
        """The scene that the agent is in."""
        ...

    @property
    def height(self) -> float:
        """Metres: of the floor that the agent stands on."""
        ...

    @property
    def revision(self) -> int:
        """Its goal revision."""
        ...

    @property
    def body(self) -> BodyState:
        """The agent as planned."""
        ...

    @property
    def is_moving(self) -> bool:
        """Whether its present goal was not one to stand at."""
        ...

    @property
    def stood_at(self) -> Vector | None:
        """Where it was to stand last; None while its goal moved."""
        ...

    @property
    def is_at_last_goal(self) -> bool:
        """Whether the goal that it is on the way to is the last one of its path."""
        ...

    def has_done(self, goal: Goal) -> bool:
        """Whether it has passed its present goal, which is `goal`, or dwelt there."""
        ...

    def here(self) -> Goal:
        """A goal where it is planned to be."""
        ...

    def look_at(self, agent_id: str) -> BodyState | None:
        """Another agent at the moment that this one is planned to.

        None: it has been deleted; then the activity has been ended.
        """
        ...

    def walk_with(self, agent_id: str) -> None:
        """Puts it into one group with another agent: they do not avoid each other."""
        ...

    def extend(self, goal: Goal) -> None:
        """Add a goal to its path."""
        ...

    def aim(self, aim: Aim, on_floor_of: str | None = None) -> None:
        """Move its goal; in a scene to free ground on its floor, or on that of another agent."""
        ...

    def shared(self, make: Callable[["Others"], T]) -> T:
        """The one value of a world that `make` has made."""
        ...


class Behaviour:
    """A frozen dataclass in a separate file, with its checks and its next goals.

    An agent follows it until its next goal command. It makes one revision.
    """

    __slots__ = ()

    WALKS: ClassVar[bool] = False
    """Whether its first goal is a place to walk to, not a goal that moves before the next step."""

    FROM_PLACE_TO_PLACE: ClassVar[bool] = False
    """`next_goal` is asked for when the agent is on the way to its last goal."""

    NEEDS_OTHERS: ClassVar[bool] = False
    """It depends on other agents, so an agent's motion does not follow from its own commands."""

    @property
    def named_agent(self) -> str:
        """Id of the agent that it depends on; empty: it names none."""
        return ""

    @property
    def given_goals(self) -> tuple[Goal, ...]:
        """The goals that it holds."""
        return ()

    @property
    def needs_scene(self) -> bool:
        """It works in a scene only."""
        return False

    def check(self, start: Start, limits: Limits, where: str) -> None:
        """For an agent at `start`. Raises InvalidArgument that names the field below `where`."""

    def check_others(self, agent: "Agent", others: Others) -> None:
        """That an agent may follow this behaviour among the others. Raises InvalidArgument."""

    def first_goals(self, actor: BehavingAgent, number: int) -> tuple[Goal, ...]:
        """Its first goals, from goal `number` of the path on."""
        return (self.next_goal(actor, number),)

    def next_goal(self, actor: BehavingAgent, number: int) -> Goal:
        """Goal `number` of the path; here, unless it goes from place to place."""
        return actor.here()

    def update(self, actor: BehavingAgent) -> None:
        """Before a step of the agent: extend its path, or move its goal."""
        if self.FROM_PLACE_TO_PLACE and actor.is_at_last_goal:
            agent = actor.agent
            actor.extend(self.next_goal(actor, agent.passed + len(agent.path)))

    def is_over(self, actor: BehavingAgent) -> bool:
        """It has ended by itself."""
        return False


@dataclass(slots=True)
class Agent:
    """The record of an agent, in addition to its slot."""

    agent_id: str
    alias: int
    session_id: str
    spec: AgentSpec
    slot: int
    created_at: float
    path: tuple[Goal, ...] = ()  # without the goals that are forgotten
    passed: int = 0  # place of the first of them in the path, as it was given
    path_start: tuple[float, float] = (0.0, 0.0)  # where the way to the first of them begins
    behaviour: Behaviour | None = None  # that it follows
    part: int = 0  # of a routine
    begun: int = 0  # place in the path of the first goal of the behaviour, or of the part
    begun_seq: int = 0  # of the first chunk that was planned for it
    commanded_seq: int = 0  # of the first chunk that its last command counts for
