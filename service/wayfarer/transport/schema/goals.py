"""Goals, paths, wandering."""

from pydantic import ConfigDict, Field

from wayfarer.transport.schema.base import Bool, Float, Many, Message, Vector3, bounds
from wayfarer.world.behaviours.wander import MIN_RADIUS
from wayfarer.world.goals.checks import RADIUS, SPEED


class Goal(Message):
    """A place to walk to, and how."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"position": {"x": 2, "y": 0, "z": 3}, "speed": 1.4}]}
    )

    position: Vector3 = Field(
        description="the ground below it is walked to: without a scene the component along up is "
        "ignored, in a scene it says on which storey"
    )
    radius: Float | None = Field(
        default=None,
        description="arrived when this near; 0.05 to 10 m; 0.3 m",
        json_schema_extra=bounds(*RADIUS),
    )
    speed: Float | None = Field(
        default=None,
        description="on the way; 0.2 to 4 m/s; 1.2 m/s",
        json_schema_extra=bounds(*SPEED),
    )
    heading: Float | None = Field(
        default=None,
        ge=-100,
        le=100,
        description="to face once stopped there: radians about up, 0 faces the basis's forward",
    )
    stop: Bool | None = Field(
        default=None, description="false: pass through without slowing, stop after the last; true"
    )
    strafe: Bool | None = Field(
        default=None, description="face `heading` on the way, too: side steps, up to 0.6 m/s; false"
    )
    dwell: Float | None = Field(
        default=None,
        ge=0,
        le=3600,
        description="seconds to stand there before the next goal; 0",
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

    center: Vector3 = Field(description="the component along up is ignored")
    radius: Float = Field(
        description="from 0.5 m to limits.goal_distance_m",
        json_schema_extra=bounds(MIN_RADIUS, None),
    )


class Wander(Message):
    """Asks an agent to walk about until it is told otherwise."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"area": {"center": {"x": 0, "y": 0, "z": 0}, "radius": 5}, "dwell": 2}]
        }
    )

    area: Area | None = Field(default=None, description="none: all over the scene")
    speed: Float | None = Field(
        default=None,
        description="on the way; 0.2 to 4 m/s; 1.2 m/s",
        json_schema_extra=bounds(*SPEED),
    )
    dwell: Float | None = Field(
        default=None, ge=0, le=3600, description="seconds to stand at each place; 0"
    )


class GoalRevision(Message):
    """The change was taken."""

    revision: int = Field(description="of the agent's goal; chunks planned for it carry it")
