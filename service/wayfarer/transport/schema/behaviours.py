"""Behaviours of agents, see goal.proto."""

from typing import ClassVar, Final

from pydantic import ConfigDict, Field

from wayfarer.transport.schema.base import (
    Bool,
    Float,
    Heading,
    Length,
    Many,
    Message,
    OneOf,
    Spot,
    length_field,
    speed_field,
)
from wayfarer.transport.schema.goals import Goal, Wander
from wayfarer.world.behaviours import follow, keep_away, queue
from wayfarer.world.behaviours.follow import MAX_BESIDE
from wayfarer.world.behaviours.keep_away import DISTANCE
from wayfarer.world.behaviours.queue import SPACING
from wayfarer.world.behaviours.routine import MAX_PARTS, MAX_SECONDS

BESIDE: Final = (-MAX_BESIDE, MAX_BESIDE)
QUEUE: Final = queue.Queue("", (0.0, 0.0), 0.0)
GOALS = Field(
    min_length=1, max_length=1024, description="goals in order; at most limits.path_goals"
)


class Patrol(Message):
    """Visits goals again and again."""

    goals: Many[Goal] = GOALS
    to_and_fro: Bool = Field(
        default=False,
        description="true: back the way it came; false: from the last goal to the first",
    )


class Follow(Message):
    """Keeps a place relative to another agent, at its pace."""

    agent_id: str = Field(max_length=64, description="the other agent, of the same session")
    behind: Length | None = length_field(
        "distance behind it, negative ahead of it", BESIDE, follow.Follow("").behind
    )
    right: Length | None = length_field(
        "distance to its right, negative to its left", BESIDE, follow.Follow("").right
    )


class KeepAway(Message):
    """Stands until another agent, or a place, is too near, then walks away."""

    agent_id: str = Field(
        default="", max_length=64, description="the agent to keep away from; or `place`"
    )
    place: Spot | None = Field(
        default=None, description="the place to keep away from; or `agent_id`"
    )
    distance: Length | None = length_field(
        "distance below which it walks away", DISTANCE, keep_away.KeepAway().distance
    )
    speed: Length | None = speed_field("target speed", keep_away.KeepAway().speed)


class Queue(Message):
    """Lines up. Agents of a session with one queue name form one line; the first places it."""

    name: str = Field(min_length=1, max_length=64, description="name of the queue")
    head: Spot = Field(description="where the first agent stands")
    heading: Heading = Field(
        default=0.0,
        description="heading of the waiting agents; the line grows in the opposite direction",
    )
    spacing: Length | None = length_field("distance between neighbours", SPACING, QUEUE.spacing)
    speed: Length | None = speed_field("target speed", QUEUE.speed)


class Visit(Message):
    """Visits goals in turn, once."""

    goals: Many[Goal] = GOALS


class Stand(Message):
    """Stands where the agent is."""


class Part(OneOf):
    """A part of a routine."""

    BESIDE: ClassVar[frozenset[str]] = frozenset({"seconds"})

    visit: Visit | None = None
    stand: Stand | None = None
    wander: Wander | None = None
    patrol: Patrol | None = None
    follow: Follow | None = None
    keep_away: KeepAway | None = None
    queue: Queue | None = None
    seconds: Float = Field(
        default=0.0,
        ge=0,
        le=MAX_SECONDS,
        description="seconds until the next part; 0: when this part is done, as a visit is",
    )


class Routine(Message):
    """Several parts one after the other."""

    parts: Many[Part] = Field(min_length=1, max_length=MAX_PARTS, description="the parts in order")
    repeat: Bool = Field(
        default=False, description="after the last part, begin again; false: stand"
    )


class Behaviour(OneOf):
    """What an agent does by itself until its next goal command."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "routine": {
                        "parts": [
                            {"wander": {}, "seconds": 60},
                            {"queue": {"name": "till", "head": {"x": 2, "y": 0, "z": 3}}},
                        ]
                    }
                }
            ]
        }
    )

    wander: Wander | None = None
    patrol: Patrol | None = None
    follow: Follow | None = None
    keep_away: KeepAway | None = None
    queue: Queue | None = None
    routine: Routine | None = None
