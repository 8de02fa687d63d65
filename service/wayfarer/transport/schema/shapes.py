"""Shapes of which scenes are made. Points and lengths are in the basis of the scene."""

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
        description="corners in order, either way round; the component along up is ignored",
    ),
]
Turn = Annotated[
    Heading, Field(description="by how much it is turned: radians about up, as an agent's heading")
]
Base = Annotated[Vector3, Field(description="the middle of its base")]


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
    Field(description="extents along the axes of the basis, before it is turned; 0.01 to 500 m"),
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
    holes: Many[Outline] = Field(default=(), max_length=MAX_SOLIDS, description="inside of it")
    height: Float = Field(default=0.0, description="its component along up")


class Box(Message):
    """A box, standing upright."""

    position: Base
    size: Size
    heading: Turn = 0.0


class Cylinder(Message):
    """A cylinder, standing upright."""

    position: Base
    radius: Float = Field(
        description="0.005 to 500 m", json_schema_extra=bounds(MIN_SIZE / 2, MAX_EXTENT)
    )
    height: Height


class Prism(Message):
    """An outline raised along up."""

    outline: Corners
    bottom: Float = Field(default=0.0, description="height of its base")
    height: Height


class Ramp(Message):
    """A wedge that can be walked up: it rises along the basis's forward before it is turned."""

    position: Base
    size: Size
    heading: Turn = 0.0


class Solid(OneOf):
    """A solid that never moves; its top is ground where it can be stepped on."""

    box: Box | None = None
    cylinder: Cylinder | None = None
    prism: Prism | None = None
    ramp: Ramp | None = None


class Obstacle(OneOf):
    """A solid that can be added, moved and removed; it always blocks the way."""

    model_config = ConfigDict(json_schema_extra={"examples": [CRATE]})

    box: Box | None = None
    cylinder: Cylinder | None = None
    prism: Prism | None = Field(default=None, description=f"of at most {MAX_OBSTACLE_RING} points")


class Walkable(Message):
    """The walkers that a scene is baked for. Absent fields take their defaults."""

    radius: Length | None = length_field(
        "from the middle of an agent to walls and edges", RADIUS, WALKABLE.radius
    )
    step_height: Length | None = length_field(
        "up or down in one step, less than `height`", STEP_HEIGHT, WALKABLE.step_height
    )
    slope_deg: Float | None = Field(
        default=None,
        ge=SLOPE_DEG[0],
        le=SLOPE_DEG[1],
        description=f"steeper ground is a wall; degrees; default {WALKABLE.slope_deg:g}",
    )
    height: Length | None = length_field("free above the ground", HEIGHT, WALKABLE.height)
