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
from wayfarer.world.agents import goal
from wayfarer.world.agents.goal import RADIUS
from wayfarer.world.behaviours.wander import MIN_RADIUS

GOAL: Final = goal.Goal((0.0, 0.0, 0.0))
"""Its fields are the defaults."""


class Goal(Message):
    """A place to walk to, and how."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"position": {"x": 2, "y": 0, "z": 3}, "speed": 1.4}]}
    )

    position: Vector3 = Field(
        description="place on the ground; the component along up selects the storey of a scene, "
        "and is ignored without one"
    )
    radius: Length | None = length_field(
        "distance of the hips at which it is reached", RADIUS, GOAL.radius
    )
    speed: Length | None = speed_field("target speed", GOAL.speed)
    heading: Heading | None = Field(
        default=None,
        description="heading after stopping there: radians about up, 0 faces the basis's forward; "
        "any if absent",
    )
    stop: Bool | None = Field(
        default=None,
        description="false: pass through without slowing; if no goal follows, stop beyond it; "
        "default true",
    )
    strafe: Bool | None = Field(
        default=None,
        description="hold `heading` on the way, too: side steps, up to 1.2 m/s; default false",
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
        min_length=1, max_length=1024, description="goals in order; at most limits.path_goals"
    )


class Area(Message):
    """A disc to walk about in."""

    center: Spot = Field(description="its centre; the component along up is ignored")
    radius: Length = Field(
        description=f"{MIN_RADIUS:g} m to limits.goal_distance_m",
        json_schema_extra=bounds(MIN_RADIUS, None),
    )


class Wander(Message):
    """Walk from one random place to the next, until the next goal command."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"area": {"center": {"x": 0, "y": 0, "z": 0}, "radius": 5}, "dwell": 2}]
        }
    )

    area: Area | None = Field(
        default=None, description="where to walk about; absent: all over the scene"
    )
    speed: Length | None = speed_field("target speed", GOAL.speed)
    dwell: Dwell | None = Field(
        default=None, description="seconds to stand at each place; default 0"
    )


class GoalRevision(Message):
    """The command was accepted."""

    revision: int = Field(
        description="the agent's new revision; chunks planned for the command carry it"
    )
