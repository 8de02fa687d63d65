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


class NewExampleScene(Message):
    """How to create a scene that comes with the server."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"basis": "gltf"}]})

    basis: Basis = Field(default=Basis.GLTF, description="basis of all calls on the scene")
    lease_s: Lease = None
    request_id: RequestId = ""


class ExampleScene(Message):
    """A scene that comes with the server."""

    name: str = Field(description="name for createExampleScene")
    summary: str


class ExampleScenes(Message):
    """The scenes that come with the server."""

    examples: tuple[ExampleScene, ...]


class NamedObstacle(Message):
    """An obstacle in a scene."""

    name: str
    obstacle: Obstacle


class Scene(Message):
    """A scene as it is now."""

    scene_id: str = Field(description="id, also for createSession")
    name: str
    basis: BasisInfo
    content_hash: str = Field(
        description="SHA-256 of its content; scenes of equal content share their navigation data"
    )
    version: int = Field(description="number of changes of its obstacles")
    area_m2: float = Field(description="square metres on which the middle of an agent may be")
    islands: int = Field(description="parts of its ground that no way connects")
    min: Vector3 = Field(description="least coordinates of its ground; 0 along up")
    max: Vector3 = Field(description="greatest coordinates of its ground; 0 along up")
    obstacles: tuple[NamedObstacle, ...] = Field(description="its obstacles")
    sessions: int = Field(description="number of sessions in it")
    created_at_us: int = Field(description="microseconds since the Unix epoch")
    bake_s: float = Field(description="seconds that baking took")
    lease_s: float = Field(description="seconds it outlives its last session and call")
    endpoint: Endpoint | None = Field(
        default=None, description="the node that holds it; null on a server of one process"
    )
    notes: tuple[str, ...] = Field(
        default=(),
        description="what its level's author should know, one sentence each: what was left out, "
        "what looks wrong",
    )


class Scenes(Message):
    """The caller's scenes."""

    scenes: tuple[Scene, ...] = Field(description="oldest first")


class SceneVersion(Message):
    """A scene after a change."""

    version: int
    area_m2: float
    islands: int


class PathQuery(Message):
    """A path to find."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"start": {"x": -5, "y": 0, "z": -5}, "goal": {"x": 5, "y": 0, "z": 5}}]
        }
    )

    start: Vector3 = Field(
        description="start of the path; the component along up selects the storey"
    )
    goal: Vector3 = Field(description="end of the path")


class ScenePath(Message):
    """A path."""

    points: tuple[Vector3, ...] = Field(description="points from start to goal, on the ground")
    length: float = Field(description="length seen from above")
    start_moved: float = Field(
        description="distance by which start was moved to free ground; 0 if it was free"
    )
    goal_moved: float = Field(
        description="distance by which goal was moved to ground that can be reached"
    )
    version: int = Field(description="version of the scene in which the path was found")


class Ring(Message):
    """A closed line."""

    points: tuple[float, ...] = Field(description="three numbers per point")


class Polygon(Message):
    """An area seen from above; 0 along up."""

    outline: tuple[float, ...] = Field(description="three numbers per point")
    holes: tuple[Ring, ...]


class Block(Message):
    """A solid or obstacle, upright from its bottom to its top."""

    top: tuple[float, ...] = Field(
        description="outline of its top, three numbers per point; level, except for a ramp"
    )
    bottom: float = Field(description="component along up of its bottom")
    name: str = Field(default="", description="name of an obstacle")


class SceneOutlines(Message):
    """Everything needed to draw a scene, with numbers as graphics libraries take them."""

    walkable: tuple[Polygon, ...] = Field(
        description="ground on which the middle of an agent may be"
    )
    vertices: tuple[float, ...] = Field(
        description="vertices of the walkable ground, three numbers each"
    )
    triangles: tuple[int, ...] = Field(description="three indices of vertices each")
    solids: tuple[Block, ...] = Field(description="permanent solids, without meshes")
    obstacles: tuple[Block, ...] = Field(description="its obstacles")
    version: int


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


class CrowdCame(Message):
    """How many people have come."""

    came: int = Field(
        description="people who are there; streams announce them, and later ones, in `added`"
    )
    waiting: int = Field(description="people who come when there is room")
    reason: str = Field(description="why they wait; empty: nothing keeps them")
