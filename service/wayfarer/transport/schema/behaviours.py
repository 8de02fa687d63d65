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
GOALS = Field(min_length=1, max_length=1024, description="in turn; at most limits.path_goals")


class Patrol(Message):
    """Visiting goals again and again."""

    goals: Many[Goal] = GOALS
    to_and_fro: Bool = Field(
        default=False, description="back the way it came; false: from the last to the first"
    )


class Follow(Message):
    """Keeping to a place relative to another agent, walking as it walks."""

    agent_id: str = Field(max_length=64, description="the other, of the same session")
    behind: Length | None = length_field(
        "how far behind it, negative before it", BESIDE, follow.Follow("").behind
    )
    right: Length | None = length_field(
        "how far to its right, negative to its left", BESIDE, follow.Follow("").right
    )


class KeepAway(Message):
    """Standing until somebody, or a place, is too near, then walking away."""

    agent_id: str = Field(default="", max_length=64, description="from this agent; or give `place`")
    place: Spot | None = Field(default=None, description="from this place; or give `agent_id`")
    distance: Length | None = length_field(
        "nearer is too near", DISTANCE, keep_away.KeepAway().distance
    )
    speed: Length | None = speed_field("of walking away", keep_away.KeepAway().speed)


class Queue(Message):
    """Lining up; queues of one name in a session are one, and the first in it says where it is."""

    name: str = Field(min_length=1, max_length=64)
    head: Spot = Field(description="where the first one stands")
    heading: Heading = Field(
        default=0.0,
        description="which way the waiting agents face; the line grows to the other side",
    )
    spacing: Length | None = length_field("between neighbours", SPACING, QUEUE.spacing)
    speed: Length | None = speed_field("of moving up", QUEUE.speed)


class Visit(Message):
    """Visiting goals in turn, once."""

    goals: Many[Goal] = GOALS


class Stand(Message):
    """Standing where one is."""


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
        description="then the next; 0: when it is done, as a visit is",
    )


class Routine(Message):
    """One thing after the other."""

    parts: Many[Part] = Field(min_length=1, max_length=MAX_PARTS, description="in order")
    repeat: Bool = Field(default=False, description="begin again after the last; false: stand")


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
