"""Messages about scenes to and from the world: plain and frozen, in world space."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from wayfarer.errors import Text
from wayfarer.navigation.scene_spec import Obstacle, Point3, Ring, SceneSpec


@dataclass(frozen=True, slots=True)
class SceneSource:
    """A scene to create."""

    spec: SceneSpec
    name: str = ""  # shown by clients; need not be unique
    attributes: Mapping[str, str] = field(default_factory=dict)  # the transport's: kept, not read


@dataclass(frozen=True, slots=True)
class SceneInfo:
    """A scene as it is now."""

    scene_id: str
    name: str
    content_hash: str  # of its spec: equal specs share one bake
    version: int  # counts the changes of its obstacles
    area: float  # square metres where the middle of an agent may be
    islands: int
    bounds: tuple[float, float, float, float]  # x0, y0, x1, y1 of the ground
    obstacles: Mapping[str, Obstacle]
    sessions: int  # number of sessions in it
    created_at: float  # Unix seconds
    bake_s: float  # duration of its bake in seconds
    attributes: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[Text, ...] = ()  # remarks for its level's author


@dataclass(frozen=True, slots=True)
class Block:
    """A solid to be drawn: the outline of its top, and the height of its foot."""

    top: tuple[Point3, ...]  # level, except a ramp's
    bottom: float


@dataclass(frozen=True, slots=True)
class Outlines:
    """A scene to be drawn: the ground for agents' middles, and the solids."""

    walkable: tuple[tuple[Ring, ...], ...]  # polygons: the outline, then its holes
    vertices: tuple[Point3, ...]  # of the walkable ground's triangles, on the floor
    triangles: tuple[tuple[int, int, int], ...]
    solids: tuple[Block, ...]  # static ones; a mesh has none
    obstacles: Mapping[str, Block]
    version: int


@dataclass(frozen=True, slots=True)
class Crowd:
    """People who come to a session's scene, walk about all over it, and leave again."""

    count: int  # wanted number of people at a time
    seed: int = 0  # genders, shapes, places and goals follow from it
    speed: tuple[float, float] = (0.9, 1.4)  # m/s, drawn from this range
    dwell: tuple[float, float] = (0.0, 4.0)  # seconds to stand at each place
    spawn_rate: float = 0.0  # people per second; 0: as many as there is room for, at once
    stay: float = 0.0  # mean seconds until one leaves and another comes; 0: they stay


@dataclass(frozen=True, slots=True)
class CrowdState:
    """The present state of a crowd."""

    came: int  # number of wanted people that have come
    waiting: int  # people still to come
    reason: str = ""  # why they have not come, a sentence; empty: they are about to

    @property
    def is_settled(self) -> bool:
        """Whether all have come, or none comes before something changes."""
        return not self.waiting or bool(self.reason)
