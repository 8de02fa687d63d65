"""Agents and behaviours, and the interface that each kind of behaviour implements.

The kinds are in `behaviours/`, one file each.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot
from typing import ClassVar, Final, Protocol, TypeVar

from wayfarer.config.limits import Limits
from wayfarer.navigation.scene import Scene
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal

Vector = tuple[float, float]

Start = tuple[float, float, float] | None
"""The place of an agent when it begins, metres; None: unknown."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class BodyState:
    """An agent's state as others see it."""

    place: Vector
    velocity: Vector
    facing: Vector  # unit vector

    @property
    def speed(self) -> float:
        """Metres per second."""
        return hypot(*self.velocity)


@dataclass(frozen=True, slots=True)
class Aim:
    """The present aim of an agent. `place` None: it should stand."""

    place: Vector | None
    speed: float = 1.2
    onward: Vector | None = None  # unit vector: it is passed through in that direction
    facing: Vector | None = None  # unit vector to face once there


STAND: Final = Aim(None)


class Others(Protocol):
    """The agents of a session, as behaviours may see them."""

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
        """The planned place of an agent."""
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
        """Height in metres of the floor below the agent."""
        ...

    @property
    def revision(self) -> int:
        """Its goal revision."""
        ...

    @property
    def body(self) -> BodyState:
        """The agent's planned state."""
        ...

    @property
    def is_moving(self) -> bool:
        """Whether its present goal was not one to stand at."""
        ...

    @property
    def stood_at(self) -> Vector | None:
        """The place where it last should stand; None while its goal moved."""
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
        """Another agent's state at the moment up to which this one is planned.

        None: it has been deleted, and the activity has been ended.
        """
        ...

    def walk_with(self, agent_id: str) -> None:
        """Puts it into one group with another agent: they do not avoid each other."""
        ...

    def extend(self, goal: Goal) -> None:
        """Adds a goal to its path."""
        ...

    def aim(self, aim: Aim, on_floor_of: str | None = None) -> None:
        """Moves its goal; in a scene to free ground on its floor, or on another agent's floor."""
        ...

    def shared(self, make: Callable[["Others"], T]) -> T:
        """The only value of a world that `make` has made."""
        ...


class Behaviour:
    """A frozen dataclass in a separate file, with its checks and its next goals.

    An agent follows it until its next goal command. It counts as one revision.
    """

    __slots__ = ()

    WALKS: ClassVar[bool] = False
    """Whether its first goal is a fixed place, not one that moves before the next step."""

    FROM_PLACE_TO_PLACE: ClassVar[bool] = False
    """Whether `next_goal` is called when the agent is on the way to its last goal."""

    NEEDS_OTHERS: ClassVar[bool] = False
    """Whether it depends on other agents, so that own commands alone do not determine motion."""

    @property
    def named_agent(self) -> str:
        """Id of the agent that it depends on; empty: none."""
        return ""

    @property
    def given_goals(self) -> tuple[Goal, ...]:
        """The goals that it contains."""
        return ()

    @property
    def needs_scene(self) -> bool:
        """Whether it works only in a scene."""
        return False

    def check(self, start: Start, limits: Limits, where: str) -> None:
        """Checks it for an agent at `start`. Raises InvalidArgument with a field below `where`."""

    def check_others(self, agent: "Agent", others: Others) -> None:
        """Checks whether an agent may follow it among the others. Raises InvalidArgument."""

    def first_goals(self, actor: BehavingAgent, number: int) -> tuple[Goal, ...]:
        """Its first goals, from goal `number` of the path on."""
        return (self.next_goal(actor, number),)

    def next_goal(self, actor: BehavingAgent, number: int) -> Goal:
        """Goal `number` of the path; the present place, unless it goes from place to place."""
        return actor.here()

    def update(self, actor: BehavingAgent) -> None:
        """Called before a step of the agent: extends its path, or moves its goal."""
        if self.FROM_PLACE_TO_PLACE and actor.is_at_last_goal:
            agent = actor.agent
            actor.extend(self.next_goal(actor, agent.passed + len(agent.path)))

    def is_over(self, actor: BehavingAgent) -> bool:
        """Whether it has ended by itself."""
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
    behaviour: Behaviour | None = None  # the one that it follows
    part: int = 0  # of a routine
    begun: int = 0  # place in the path of the first goal of the behaviour, or of the part
    begun_seq: int = 0  # of the first chunk that was planned for it
    commanded_seq: int = 0  # of the first chunk to which its last command applies
