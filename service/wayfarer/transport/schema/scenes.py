"""Scenes. Points and lengths are in the basis of the scene, see scene.proto."""

from enum import StrEnum
from typing import Annotated, Final

from pydantic import ConfigDict, Field, JsonValue

from wayfarer.navigation.checks import UNIT
from wayfarer.navigation.scene_spec import MAX_FLOORS, MAX_SOLIDS
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.schema.base import (
    Dwell,
    Float,
    Length,
    Many,
    Message,
    Text,
    Uint32,
    Vector3,
    speed_field,
)
from wayfarer.transport.schema.shapes import CRATE, Floor, Solid, Walkable
from wayfarer.world.scenes import messages
from wayfarer.world.scenes.populate import MAX_RATE, MAX_STAY

CROWD: Final = messages.Crowd(0)
"""Its fields are the defaults."""

Lease = Annotated[
    Float | None,
    Field(
        ge=1,
        description="seconds it outlives its last session and call; to limits.lease_s; default 1 h",
    ),
]

RequestId = Annotated[Text, Field(description="as in createSession, or the header Idempotency-Key")]

SQUARE: Final[JsonValue] = [
    {"x": x, "y": 0, "z": z} for x, z in ((-10, -10), (10, -10), (10, 10), (-10, 10))
]


class NewScene(Message):
    """A scene to create."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"name": "yard", "floors": [{"outline": SQUARE}], "solids": [CRATE]}]
        }
    )

    basis: Basis = Field(default=Basis.GLTF, description="basis of all calls on the scene")
    name: Text = Field(default="", description="name for display; need not be unique")
    floors: Many[Floor] = Field(
        default=(),
        max_length=MAX_FLOORS,
        description="level ground: at least one floor, unless there is a mesh",
    )
    solids: Many[Solid] = Field(default=(), max_length=MAX_SOLIDS, description="permanent solids")
    walkable: Walkable = Field(default=Walkable(), description="what ground can be walked on")
    entries: Many[Vector3] = Field(
        default=(),
        max_length=MAX_SOLIDS,
        description="where agents enter: only ground reachable from there is kept; none: islands "
        "of at least a twentieth of the largest one's area",
    )
    lease_s: Lease = None
    request_id: RequestId = ""


class MeshFormat(StrEnum):
    """File formats of meshes."""

    GLB = "glb"
    OBJ = "obj"
    PLY = "ply"


class Mesh(Message):
    """What a mesh file holds."""

    format: MeshFormat = MeshFormat.GLB
    basis: Basis | None = Field(
        default=None,
        description="axes of its coordinates; if absent gltf for GLB, else the scene's",
    )
    unit: Float | None = Field(
        default=None,
        ge=UNIT[0],
        le=UNIT[1],
        description="metres per unit of the file; as in its basis if absent",
    )


class MeshScene(Message):
    """A scene to create from a mesh."""

    scene: NewScene = NewScene()
    mesh: Mesh = Mesh()


class Crowd(Message):
    """People who walk about in a session's scene."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"count": 50, "seed": 7}]})

    count: Uint32 = Field(default=0, description="number of people at a time; 0: all leave")
    seed: Uint32 | None = Field(
        default=None,
        description="determines genders, shapes, places and goals; chosen by the server if absent",
    )
    min_speed: Length | None = speed_field("speed of the slowest person", CROWD.speed[0])
    max_speed: Length | None = speed_field("speed of the fastest person", CROWD.speed[1])
    min_dwell: Dwell | None = Field(
        default=None,
        description=f"least seconds to stand at each place; default {CROWD.dwell[0]:g}",
    )
    max_dwell: Dwell | None = Field(
        default=None,
        description=f"most seconds to stand at each place; default {CROWD.dwell[1]:g}",
    )
    spawn_rate: Float = Field(
        default=0.0,
        ge=0,
        le=MAX_RATE,
        description="arrivals per second; 0: all at once, as far as there is room",
    )
    stay: Float = Field(
        default=0.0,
        ge=0,
        le=MAX_STAY,
        description="mean seconds until a person leaves and another comes; 0: they stay",
    )
