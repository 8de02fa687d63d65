"""What agents do of themselves, see goal.proto."""

from typing import ClassVar

from pydantic import ConfigDict, Field

from wayfarer.transport.schema.base import Bool, Float, Many, Message, OneOf, Vector3, bounds
from wayfarer.transport.schema.goals import Goal, Wander
from wayfarer.world.behaviours.follow import MAX_BESIDE
from wayfarer.world.behaviours.keep_away import DISTANCE
from wayfarer.world.behaviours.queue import SPACING
from wayfarer.world.behaviours.routine import MAX_PARTS, MAX_SECONDS
from wayfarer.world.goals.checks import SPEED

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
    behind: Float | None = Field(
        default=None,
        description="how far behind it, negative before it; to 10 m; 1.2 m",
        json_schema_extra=bounds(-MAX_BESIDE, MAX_BESIDE),
    )
    right: Float | None = Field(
        default=None,
        description="how far to its right, negative to its left; to 10 m; 0",
        json_schema_extra=bounds(-MAX_BESIDE, MAX_BESIDE),
    )


class KeepAway(Message):
    """Standing until somebody, or a place, is too near, then walking away."""

    agent_id: str = Field(default="", max_length=64, description="from this agent; or give `place`")
    place: Vector3 | None = Field(default=None, description="from this place; or give `agent_id`")
    distance: Float | None = Field(
        default=None, description="0.5 to 50 m; 4 m", json_schema_extra=bounds(*DISTANCE)
    )
    speed: Float | None = Field(
        default=None, description="0.2 to 4 m/s; 1.6 m/s", json_schema_extra=bounds(*SPEED)
    )


class Queue(Message):
    """Lining up; queues of one name in a session are one, and the first in it says where it is."""

    name: str = Field(min_length=1, max_length=64)
    head: Vector3 = Field(description="where the first one stands")
    heading: Float = Field(
        default=0.0,
        ge=-100,
        le=100,
        description="which way those who wait face; the line grows to the other side",
    )
    spacing: Float | None = Field(
        default=None,
        description="between them; 0.5 to 5 m; 0.8 m",
        json_schema_extra=bounds(*SPACING),
    )
    speed: Float | None = Field(
        default=None, description="0.2 to 4 m/s; 1.2 m/s", json_schema_extra=bounds(*SPEED)
    )


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
    """What an agent does of itself until it is told otherwise."""

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
