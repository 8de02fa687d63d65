"""What agents do of themselves until they are told otherwise: plain frozen messages, world space.

Each is an order (commands.py). One revision counts for all of it. Beside these there is `Wander`
(agent.py). What depends on others works among the agents of one session.
"""

from dataclasses import dataclass
from typing import Literal

from wayfarer.runtime.agent import Goal, Wander


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


Behaviour = Wander | Patrol | Follow | KeepAway | Queue
"""Goes on until another order."""


@dataclass(frozen=True, slots=True)
class Part:
    """Of a routine."""

    does: Visit | Stand | Behaviour
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


DEPENDENT = (Follow, KeepAway, Queue)
"""Kinds that look at other agents, so that one agent's motion does not follow from its orders."""
