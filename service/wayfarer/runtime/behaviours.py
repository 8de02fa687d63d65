"""Behaviours that an agent follows until its next goal command: plain frozen messages, world space.

Each is a `GoalCommand` (commands.py) and makes one revision. A behaviour that depends on other
agents works among the agents of one session.
"""

from dataclasses import dataclass
from typing import Literal

from wayfarer.runtime.agent import Goal


@dataclass(frozen=True, slots=True)
class Wander:
    """Walking about in a disc, or all over the scene, from one random place to another.

    Places are drawn from the agent's seed, its revision and their number in the path.
    """

    center: tuple[float, float] | None  # metres, world; None: wherever the agent's scene is free
    radius: float = 0.0  # metres; ignored without a centre
    speed: float = 1.2  # m/s
    dwell: float = 0.0  # seconds to stand at each place
    kind: Literal["wander"] = "wander"


@dataclass(frozen=True, slots=True)
class Patrol:
    """Visiting goals again and again."""

    goals: tuple[Goal, ...]
    to_and_fro: bool = False  # back the way one came; else from the last straight to the first
    kind: Literal["patrol"] = "patrol"


@dataclass(frozen=True, slots=True)
class Follow:
    """Keeping to a place relative to another agent: walking as it walks, standing as it stands.

    Those who follow one another are a group, who do not avoid each other as strangers. It ends,
    and the agent stops, when the other is deleted.
    """

    agent_id: str
    behind: float = 1.2  # metres behind it; negative: before it
    right: float = 0.0  # metres to its right; negative: to its left
    kind: Literal["follow"] = "follow"


@dataclass(frozen=True, slots=True)
class KeepAway:
    """Standing until an agent, or a place, is nearer than `distance`; then walking away from it.

    Exactly one of `agent_id` and `place` is given. It ends when the other agent is deleted.
    """

    agent_id: str = ""
    place: tuple[float, float] | None = None  # metres, on the floor
    distance: float = 4.0  # metres; the agent stops when it is a quarter farther away than that
    speed: float = 1.6  # m/s
    kind: Literal["keep_away"] = "keep_away"


@dataclass(frozen=True, slots=True)
class Queue:
    """Lining up: the first stands at the head, the others behind it as they come.

    Queues of one name are one, and the first agent in it says where it is. When one leaves, by
    another order or by being deleted, those behind it move up.
    """

    name: str
    head: tuple[float, float]  # metres, on the floor
    heading: float  # radians about +Z that those who wait face; the line grows to the other side
    spacing: float = 0.8  # metres from one to the next
    speed: float = 1.2  # m/s
    kind: Literal["queue"] = "queue"


@dataclass(frozen=True, slots=True)
class Visit:
    """Visiting goals in turn, once."""

    goals: tuple[Goal, ...]
    kind: Literal["visit"] = "visit"


@dataclass(frozen=True, slots=True)
class Stand:
    """Standing where one is."""

    kind: Literal["stand"] = "stand"


Activity = Visit | Stand | Wander | Patrol | Follow | KeepAway | Queue
"""What an agent does at one time."""


@dataclass(frozen=True, slots=True)
class Part:
    """Of a routine."""

    does: Activity
    seconds: float = 0.0  # then the next part begins; 0: when it is done, as only a visit ever is


@dataclass(frozen=True, slots=True)
class Routine:
    """One thing after the other: patrol for a minute, queue for ten seconds, then go home.

    A part ends after its seconds, a visit also when its last goal has been reached and dwelt at,
    following and keeping away also when the other is deleted. After the last part the agent stands,
    or begins again.
    """

    parts: tuple[Part, ...]
    repeat: bool = False
    kind: Literal["routine"] = "routine"


Behaviour = Wander | Patrol | Follow | KeepAway | Queue | Routine
"""Goes on until the next goal command."""

DEPENDENT = (Follow, KeepAway, Queue)
"""Kinds that look at other agents, so an agent's motion does not follow from its own commands."""
