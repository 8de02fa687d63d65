"""Shapes of scenes. Points and lengths are in the basis of the scene."""

from typing import Annotated, Final

from pydantic import ConfigDict, Field, JsonValue

from wayfarer.navigation import scene_spec as spec
from wayfarer.navigation.checks import HEIGHT, RADIUS, SLOPE_DEG, STEP_HEIGHT
from wayfarer.navigation.scene_spec import (
    MAX_EXTENT,
    MAX_OBSTACLE_RING,
    MAX_RING,
    MAX_SOLIDS,
    MIN_SIZE,
)
from wayfarer.transport.schema.base import (
    Float,
    Heading,
    Length,
    Many,
    Message,
    OneOf,
    Vector3,
    bounds,
    length_field,
)

Corners = Annotated[
    Many[Vector3],
    Field(
        min_length=3,
        max_length=MAX_RING,
        description="corners in order, in either direction; the component along up is ignored",
    ),
]
Turn = Annotated[Heading, Field(description="rotation about up in radians, as an agent's heading")]
Base = Annotated[Vector3, Field(description="middle of its base")]


SIZES: Final = bounds(MIN_SIZE, MAX_EXTENT)
Extent = Annotated[Float, Field(ge=0, json_schema_extra=SIZES)]
WALKABLE: Final = spec.Walkable()
"""Its fields are the defaults."""


class Extents(Message):
    """Lengths along the axes of the basis."""

    x: Extent
    y: Extent
    z: Extent


Size = Annotated[
    Extents,
    Field(
        description="extents along the axes of the basis, before `heading` turns it; 0.01 to 500 m"
    ),
]
Height = Annotated[
    Float, Field(description="extent along up; 0.01 to 500 m", json_schema_extra=SIZES)
]

CRATE: Final[JsonValue] = {
    "box": {"position": {"x": 0, "y": 0, "z": 3}, "size": {"x": 2, "y": 1, "z": 1}}
}


class Outline(Message):
    """A closed line seen from above."""

    points: Corners


class Floor(Message):
    """A level piece of ground."""

    outline: Corners
    holes: Many[Outline] = Field(
        default=(), max_length=MAX_SOLIDS, description="holes inside the outline"
    )
    height: Float = Field(default=0.0, description="its component along up")


class Box(Message):
    """An upright box."""

    position: Base
    size: Size
    heading: Turn = 0.0


class Cylinder(Message):
    """An upright cylinder."""

    position: Base
    radius: Float = Field(
        description="radius; 0.005 to 500 m", json_schema_extra=bounds(MIN_SIZE / 2, MAX_EXTENT)
    )
    height: Height


class Prism(Message):
    """An outline raised along up."""

    outline: Corners
    bottom: Float = Field(default=0.0, description="component along up of its base")
    height: Height


class Ramp(Message):
    """A wedge: it rises along the basis's forward before `heading` turns it."""

    position: Base
    size: Size
    heading: Turn = 0.0


class Solid(OneOf):
    """A permanent part of a scene; surfaces that can be walked on are ground."""

    box: Box | None = None
    cylinder: Cylinder | None = None
    prism: Prism | None = None
    ramp: Ramp | None = None


class Obstacle(OneOf):
    """A solid that can be added, moved and removed; it always blocks the way."""

    model_config = ConfigDict(json_schema_extra={"examples": [CRATE]})

    box: Box | None = None
    cylinder: Cylinder | None = None
    prism: Prism | None = Field(
        default=None, description=f"an extruded outline of at most {MAX_OBSTACLE_RING} points"
    )


class Walkable(Message):
    """What ground can be walked on. Absent fields take their defaults."""

    radius: Length | None = length_field(
        "clearance of the middle of an agent from walls and edges", RADIUS, WALKABLE.radius
    )
    step_height: Length | None = length_field(
        "greatest height of a step, less than `height`", STEP_HEIGHT, WALKABLE.step_height
    )
    slope_deg: Float | None = Field(
        default=None,
        ge=SLOPE_DEG[0],
        le=SLOPE_DEG[1],
        description=f"steepest slope in degrees, else a wall; default {WALKABLE.slope_deg:g}",
    )
    height: Length | None = length_field("headroom above the ground", HEIGHT, WALKABLE.height)
