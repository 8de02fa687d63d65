"""Goals, paths, wandering."""

from typing import Final

from pydantic import ConfigDict, Field

from wayfarer.transport.schema.base import (
    Bool,
    Dwell,
    Heading,
    Length,
    Many,
    Message,
    Spot,
    Vector3,
    bounds,
    length_field,
    speed_field,
)
from wayfarer.world.agents import agent
from wayfarer.world.behaviours.wander import MIN_RADIUS
from wayfarer.world.goals.checks import RADIUS

GOAL: Final = agent.Goal((0.0, 0.0, 0.0))
"""Its fields are the defaults."""


class Goal(Message):
    """A place to walk to, and how."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"position": {"x": 2, "y": 0, "z": 3}, "speed": 1.4}]}
    )

    position: Vector3 = Field(
        description="the ground below it is walked to: without a scene the component along up is "
        "ignored, in a scene it says on which storey"
    )
    radius: Length | None = length_field("arrived when this near", RADIUS, GOAL.radius)
    speed: Length | None = speed_field("on the way", GOAL.speed)
    heading: Heading | None = Field(
        default=None,
        description="to face once stopped there: radians about up, 0 faces the basis's forward",
    )
    stop: Bool | None = Field(
        default=None,
        description="false: pass through without slowing, stop after the last; default true",
    )
    strafe: Bool | None = Field(
        default=None,
        description="face `heading` on the way, too: side steps, up to 0.6 m/s; default false",
    )
    dwell: Dwell | None = Field(
        default=None, description="seconds to stand there before the next goal; default 0"
    )


class Goals(Message):
    """Goals to visit in turn."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "goals": [
                        {"position": {"x": 0, "y": 0, "z": 4}, "stop": False},
                        {"position": {"x": 3, "y": 0, "z": 4}, "heading": 3.14, "dwell": 2},
                    ]
                }
            ]
        }
    )

    goals: Many[Goal] = Field(
        min_length=1, max_length=1024, description="at most limits.path_goals"
    )


class Area(Message):
    """An area to walk about in."""

    center: Spot = Field(description="the component along up is ignored")
    radius: Length = Field(
        description=f"from {MIN_RADIUS:g} m to limits.goal_distance_m",
        json_schema_extra=bounds(MIN_RADIUS, None),
    )


class Wander(Message):
    """Asks an agent to walk about until its next goal command."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"area": {"center": {"x": 0, "y": 0, "z": 0}, "radius": 5}, "dwell": 2}]
        }
    )

    area: Area | None = Field(default=None, description="none: all over the scene")
    speed: Length | None = speed_field("on the way", GOAL.speed)
    dwell: Dwell | None = Field(
        default=None, description="seconds to stand at each place; default 0"
    )


class GoalRevision(Message):
    """The change was taken."""

    revision: int = Field(description="of the agent's goal; chunks planned for it carry it")
