"""Scenes. Points and lengths are in the basis of the scene, see scene.proto."""

from enum import StrEnum
from typing import Annotated, Final

from pydantic import ConfigDict, Field, JsonValue

from wayfarer.navigation.checks import UNIT
from wayfarer.navigation.scene_spec import MAX_FLOORS, MAX_SOLIDS
from wayfarer.transport.basis import Basis
from wayfarer.transport.schema.base import (
    BasisInfo,
    Dwell,
    Endpoint,
    Float,
    Length,
    Many,
    Message,
    Text,
    Uint32,
    Vector3,
    speed_field,
)
from wayfarer.transport.schema.shapes import CRATE, Floor, Obstacle, Solid, Walkable
from wayfarer.world.scenes import messages
from wayfarer.world.scenes.populate import MAX_RATE, MAX_STAY

CROWD: Final = messages.Crowd(0)
"""Its fields are the defaults."""

Lease = Annotated[
    Float | None,
    Field(
        ge=1,
        description="seconds it outlives its last session and call; to limits.lease_s; 3600",
    ),
]

RequestId = Annotated[
    Text, Field(description="see createSession; the header Idempotency-Key is the same")
]

SQUARE: Final[JsonValue] = [
    {"x": x, "y": 0, "z": z} for x, z in ((-10, -10), (10, -10), (10, 10), (-10, 10))
]


class NewScene(Message):
    """Asks for a scene."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"name": "yard", "floors": [{"outline": SQUARE}], "solids": [CRATE]}]
        }
    )

    basis: Basis = Field(default=Basis.GLTF, description="basis of all calls on the scene")
    name: Text = Field(default="", description="to show; need not be unique")
    floors: Many[Floor] = Field(
        default=(), max_length=MAX_FLOORS, description="its ground: at least one, or a mesh"
    )
    solids: Many[Solid] = Field(
        default=(), max_length=MAX_SOLIDS, description="solids that never move"
    )
    walkable: Walkable = Field(default=Walkable(), description="the walkers that it is baked for")
    entries: Many[Vector3] = Field(
        default=(),
        max_length=MAX_SOLIDS,
        description="where agents enter: ground not reached from there is left out; none: all is "
        "kept that is worth it",
    )
    lease_s: Lease = None
    request_id: RequestId = ""


class MeshFormat(StrEnum):
    """File formats of meshes."""

    GLB = "glb"
    OBJ = "obj"
    PLY = "ply"


class Mesh(Message):
    """What a mesh file is."""

    format: MeshFormat = MeshFormat.GLB
    basis: Basis | None = Field(
        default=None, description="axes of its coordinates; gltf for GLB, else those of the scene"
    )
    unit: Float | None = Field(
        default=None,
        ge=UNIT[0],
        le=UNIT[1],
        description="metres per unit of the file; as its basis has them",
    )


class MeshScene(Message):
    """Asks for a scene with a mesh."""

    scene: NewScene = NewScene()
    mesh: Mesh = Mesh()


class NewExampleScene(Message):
    """Asks for a scene that comes with the server."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"basis": "gltf"}]})

    basis: Basis = Field(default=Basis.GLTF, description="basis of all calls on the scene")
    lease_s: Lease = None
    request_id: RequestId = ""


class ExampleScene(Message):
    """A scene that comes with the server."""

    name: str = Field(description="for createExampleScene")
    summary: str


class ExampleScenes(Message):
    """The scenes that come with the server."""

    examples: tuple[ExampleScene, ...]


class NamedObstacle(Message):
    """An obstacle that stands in a scene."""

    name: str
    obstacle: Obstacle


class Scene(Message):
    """A scene as it is now."""

    scene_id: str = Field(description="for createSession")
    name: str
    basis: BasisInfo
    content_hash: str = Field(description="SHA-256 of what it was made of")
    version: int = Field(description="counts the changes of its obstacles")
    area_m2: float = Field(description="where the middle of an agent may be: square metres")
    islands: int = Field(description="parts of its ground with no way between them")
    min: Vector3 = Field(description="least coordinates of its ground; 0 along up")
    max: Vector3 = Field(description="greatest coordinates of its ground; 0 along up")
    obstacles: tuple[NamedObstacle, ...] = Field(description="what has been put there")
    sessions: int = Field(description="that are in it")
    created_at_us: int = Field(description="microseconds since the Unix epoch")
    bake_s: float = Field(description="seconds that its making took")
    lease_s: float = Field(description="seconds it outlives its last session and call")
    endpoint: Endpoint | None = Field(
        default=None, description="the worker it lives in; null on a server without workers"
    )


class Scenes(Message):
    """The caller's scenes."""

    scenes: tuple[Scene, ...] = Field(description="oldest first")


class SceneVersion(Message):
    """What a change of a scene has made of it."""

    version: int
    area_m2: float
    islands: int


class PathQuery(Message):
    """Asks for a way."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"start": {"x": -5, "y": 0, "z": -5}, "goal": {"x": 5, "y": 0, "z": 5}}]
        }
    )

    start: Vector3 = Field(description="the component along up says on which storey")
    goal: Vector3


class ScenePath(Message):
    """A way."""

    points: tuple[Vector3, ...] = Field(description="from start to goal, on the ground")
    length: float = Field(description="seen from above")
    start_moved: float = Field(description="how far to the nearest free ground; 0: it was free")
    goal_moved: float = Field(description="how far to the nearest that can be reached")
    version: int = Field(description="of the scene for which this is the way")


class Ring(Message):
    """A closed line."""

    points: tuple[float, ...] = Field(description="three numbers per point")


class Polygon(Message):
    """An area seen from above; 0 along up."""

    outline: tuple[float, ...] = Field(description="three numbers per point")
    holes: tuple[Ring, ...]


class Block(Message):
    """Something that stands there, upright from its foot to its top."""

    top: tuple[float, ...] = Field(
        description="its outline, three numbers per point: level, but for a ramp's"
    )
    bottom: float = Field(description="height of its foot: its component along up")
    name: str = Field(default="", description="of an obstacle")


class SceneOutlines(Message):
    """A scene to be drawn; numbers as graphics libraries take them."""

    walkable: tuple[Polygon, ...] = Field(description="where the middle of an agent may be")
    vertices: tuple[float, ...] = Field(description="of the walkable ground, three numbers each")
    triangles: tuple[int, ...] = Field(description="three indices of vertices each")
    solids: tuple[Block, ...] = Field(description="solids that never move, without meshes")
    obstacles: tuple[Block, ...] = Field(description="what has been put there")
    version: int


class Crowd(Message):
    """Asks for people in a session's scene."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"count": 50, "seed": 7}]})

    count: Uint32 = Field(default=0, description="people to have at a time; 0: all leave")
    seed: Uint32 | None = Field(
        default=None, description="genders, shapes, places and goals follow; server's choice"
    )
    min_speed: Length | None = speed_field("of the slowest", CROWD.speed[0])
    max_speed: Length | None = speed_field("of the fastest", CROWD.speed[1])
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
        description="people a second; 0: all there is room for, at once",
    )
    stay: Float = Field(
        default=0.0, ge=0, le=MAX_STAY, description="mean seconds until one leaves; 0: they stay"
    )


class CrowdCame(Message):
    """People come."""

    came: int = Field(description="people that are there; streams introduce them and those to come")
    waiting: int = Field(description="people that are still to come, when there is room")
    reason: str = Field(description="why they wait; empty: they are coming")
