"""Behaviours of agents, for `Session.behave`, in the session's basis; see goal.proto."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

from wayfarer_client.messages import Agent, Goal, Place, vector
from wayfarer_client.v1 import goal_pb2


@dataclass(frozen=True, slots=True)
class Wander:
    """Walking about from one place drawn at random to the next."""

    center: Place | None = None  # None: all over the scene
    radius: float = 0.0
    speed: float | None = None  # None: 1.2 m/s
    dwell: float | None = None  # seconds to stand at each place


@dataclass(frozen=True, slots=True)
class Patrol:
    """Visiting goals again and again."""

    goals: Sequence[Goal]
    to_and_fro: bool = False  # back the way it came; otherwise straight from the last to the first


@dataclass(frozen=True, slots=True)
class Follow:
    """Keeping to a place relative to another agent of the session, walking as it walks."""

    agent: Agent | str
    behind: float | None = None  # negative: before it; None: 1.2 m
    right: float | None = None  # negative: to its left; None: 0


@dataclass(frozen=True, slots=True)
class KeepAway:
    """Standing until an agent, or a place, is too near, then walking away; give one of the two."""

    agent: Agent | str = ""
    place: Place | None = None
    distance: float | None = None  # None: 4 m
    speed: float | None = None  # None: 1.6 m/s


@dataclass(frozen=True, slots=True)
class Queue:
    """Lining up. Queues of one name are one; its first agent defines where it is."""

    name: str
    head: Place  # where the first one stands
    heading: float  # radians about up: where waiting agents face
    spacing: float | None = None  # None: 0.8 m
    speed: float | None = None  # None: 1.2 m/s


@dataclass(frozen=True, slots=True)
class Visit:
    """Visiting goals in turn, once: a part of a routine."""

    goals: Sequence[Goal]


@dataclass(frozen=True, slots=True)
class Stand:
    """Standing where one is: a part of a routine."""


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a routine."""

    does: "Visit | Stand | Wander | Patrol | Follow | KeepAway | Queue"
    seconds: float = 0.0  # then the next begins; 0: when it is done, which only a visit can be


@dataclass(frozen=True, slots=True)
class Routine:
    """One thing after the other."""

    parts: Sequence[Part]
    repeat: bool = False  # begin again after the last; otherwise stand


Behaviour: TypeAlias = Wander | Patrol | Follow | KeepAway | Queue | Routine

FIELDS = {
    Wander: "wander",
    Patrol: "patrol",
    Follow: "follow",
    KeepAway: "keep_away",
    Queue: "queue",
    Visit: "visit",
    Stand: "stand",
    Routine: "routine",
}


def behaviour_to_wire(behaviour: Behaviour) -> goal_pb2.Behaviour:
    """As protobuf."""
    return goal_pb2.Behaviour(**{FIELDS[type(behaviour)]: _arguments(behaviour)})


def _arguments(does: Any) -> dict[str, Any]:
    """The behaviour as a protobuf message."""
    given = {field.name: getattr(does, field.name) for field in fields(does)}
    if isinstance(does, Routine):
        parts = [
            {FIELDS[type(part.does)]: _arguments(part.does), "seconds": part.seconds}
            for part in does.parts
        ]
        return {"parts": parts, "repeat": does.repeat}
    if isinstance(does, Wander):
        center, radius = given.pop("center"), given.pop("radius")
        given["area"] = None if center is None else {"center": vector(center), "radius": radius}
    if "agent" in given:
        agent = given.pop("agent")
        given["agent_id"] = agent if isinstance(agent, str) else agent.agent_id
    if "goals" in given:
        given["goals"] = [goal.message for goal in given["goals"]]
    for name in {"place", "head"} & given.keys():
        given[name] = None if given[name] is None else vector(given[name])
    return given
