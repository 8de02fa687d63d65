"""The parts of a scene: plain data, in world space (metres, right-handed, Z up).

Nothing is checked at construction; `checks.check_spec` checks once, and names the field.
"""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Final, Literal, TypeAlias

Point2: TypeAlias = tuple[float, float]
Point3: TypeAlias = tuple[float, float, float]
Ring: TypeAlias = tuple[Point2, ...]
MeshFormat: TypeAlias = Literal["glb", "obj", "ply"]

MAX_SOLIDS: Final = 2_000
MAX_FLOORS: Final = 64
MAX_RING: Final = 2_000
"""Points of one outline."""
MAX_POINTS: Final = 50_000
"""Points of all outlines of a scene."""
MAX_OBSTACLES: Final = 500
MAX_OBSTACLE_RING: Final = 64
MAX_TRIANGLES: Final = 500_000
MAX_MESH_BYTES: Final = 64 * 2**20
MAX_EXTENT: Final = 500.0
"""Longest side of a scene, metres: beyond it a cell of the ground would be too coarse."""
MIN_SIZE: Final = 0.01
"""Metres: the smallest side of a solid."""


@dataclass(frozen=True, slots=True)
class Floor:
    """A level piece of ground: its outline, holes in it, and its height. It has no thickness."""

    outline: Ring
    holes: tuple[Ring, ...] = ()
    height: float = 0.0


@dataclass(frozen=True, slots=True)
class Box:
    """A box standing on `bottom`; size along its own x and y, turned by `yaw` (radians)."""

    center: Point2
    size: Point2
    height: float
    yaw: float = 0.0
    bottom: float = 0.0


@dataclass(frozen=True, slots=True)
class Cylinder:
    """An upright cylinder standing on `bottom`."""

    center: Point2
    radius: float
    height: float
    bottom: float = 0.0


@dataclass(frozen=True, slots=True)
class Prism:
    """An outline raised from `bottom` to `bottom + height`."""

    outline: Ring
    height: float
    bottom: float = 0.0


@dataclass(frozen=True, slots=True)
class Ramp:
    """A wedge: level with `bottom` at its own -y side, `height` above it at its +y side."""

    center: Point2
    size: Point2
    height: float
    yaw: float = 0.0
    bottom: float = 0.0


Solid: TypeAlias = Box | Cylinder | Prism | Ramp
"""Static: a floor when its top can be reached by steps, an obstacle otherwise."""
Obstacle: TypeAlias = Box | Cylinder | Prism
"""Comes and goes (doors, crates): never walked on."""


MeshAxes: TypeAlias = tuple[Point3, Point3, Point3]
Y_UP: Final[MeshAxes] = ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0))
"""glTF's: its front, +Z, is the world's +Y."""
Z_UP: Final[MeshAxes] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""The world's own."""


@dataclass(frozen=True, slots=True)
class MeshFile:
    """A level as a client sends it. `unit`: metres per unit of the file.

    `axes`: the world's axes in those of the file. GLB is always `Y_UP` and in metres by its
    standard; other values are taken as they are given.
    """

    data: bytes
    format: MeshFormat
    axes: MeshAxes = Y_UP
    unit: float = 1.0


@dataclass(frozen=True, slots=True)
class Walkable:
    """The walkers that a scene is baked for. One bake serves one radius."""

    radius: float = 0.3
    """Metres between the middle of an agent and whatever it must not touch."""
    step_height: float = 0.25
    """Metres up or down that are taken in one step."""
    slope_deg: float = 40.0
    """Steeper ground is a wall."""
    height: float = 1.9
    """Metres of free height above the floor."""


@dataclass(frozen=True, slots=True)
class SceneSpec:
    """Everything a bake depends on. At least one of `floors` and `mesh` is given."""

    floors: tuple[Floor, ...] = ()
    solids: tuple[Solid, ...] = ()
    mesh: MeshFile | None = None
    walkable: Walkable = Walkable()
    entries: tuple[Point3, ...] = ()
    """Where agents enter. Given: only ground reachable from there is kept. Empty: all islands with
    at least a twentieth of the largest one's area are kept."""

    @property
    def content_hash(self) -> str:
        """Hex SHA-256 of the content: equal specs bake to equal scenes."""
        digest = hashlib.sha256()
        for part in _parts(self):
            digest.update(len(part).to_bytes(8, "little"))
            digest.update(part)
        return digest.hexdigest()


def _parts(value: Any) -> Iterator[bytes]:
    """The value as byte strings, in an order that depends only on the value."""
    if is_dataclass(value):
        yield type(value).__name__.encode()
        for field in fields(value):
            yield from _parts(getattr(value, field.name))
    elif isinstance(value, tuple):
        yield b"(%d" % len(value)
        for item in value:
            yield from _parts(item)
    elif isinstance(value, bytes):
        yield value
    else:
        yield repr(float(value) if isinstance(value, int | float) else value).encode()
