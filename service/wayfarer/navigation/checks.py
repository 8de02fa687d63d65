"""A scene from a client, checked before anything is computed from it.

Errors name the field as the spec spells it: `solids[3].size[0]`, `floors[0].outline`.
"""

import re
from collections.abc import Callable, Sequence
from math import isfinite, isinf
from typing import Final

import numpy as np
import shapely

from wayfarer.errors import Heading, InvalidArgument, Metres, Place
from wayfarer.navigation.scene_spec import (
    MAX_EXTENT,
    MAX_FLOORS,
    MAX_MESH_BYTES,
    MAX_OBSTACLE_RING,
    MAX_POINTS,
    MAX_RING,
    MAX_SOLIDS,
    MIN_SIZE,
    Box,
    Cylinder,
    Floor,
    MeshFile,
    Obstacle,
    Point2,
    Point3,
    Prism,
    Ramp,
    Ring,
    SceneSpec,
    Solid,
    Walkable,
)
from wayfarer.spec import MAX_COORDINATE

WALKABLE: Final = {
    "radius": (0.05, 5.0),
    "step_height": (0.0, 1.0),
    "slope_deg": (0.0, 60.0),
    "height": (0.5, 5.0),
}
"""Ranges of the fields of a `Walkable`, metres and degrees."""

UNIT: Final = (1e-4, 1e3)
"""Metres per unit of a mesh."""

Writer = Callable[[float], object]
"""Writes a value: a number, or a length in the client's unit."""

REASON: Final = re.compile(r"(.+)\[(\S+) (\S+)\]")
"""Why and where an outline is not simple, from shapely's explanation."""


def check_spec(spec: SceneSpec) -> None:
    """Raises InvalidArgument unless the scene is complete, finite and within all limits."""
    if not spec.floors and spec.mesh is None:
        raise InvalidArgument("a scene needs ground: give floors, a mesh, or both", "floors")
    _count(spec.floors, MAX_FLOORS, "floors")
    _count(spec.solids, MAX_SOLIDS, "solids")
    _count(spec.entries, MAX_SOLIDS, "entries")
    points = count_points(spec)
    if points > MAX_POINTS:
        raise InvalidArgument(
            f"the scene's outlines have {points:,} points, at most {MAX_POINTS:,}", "solids"
        )
    for number, floor in enumerate(spec.floors):
        _check_floor(floor, f"floors[{number}]")
    for number, solid in enumerate(spec.solids):
        check_solid(solid, f"solids[{number}]")
    for number, entry in enumerate(spec.entries):
        check_point(entry, f"entries[{number}]")
    if spec.mesh is not None:
        _check_mesh(spec.mesh)
    _check_walkable(spec.walkable)


def check_obstacle(obstacle: Obstacle, field: str) -> None:
    """Raises InvalidArgument unless this is a box, cylinder or prism within all limits."""
    if not isinstance(obstacle, Box | Cylinder | Prism):
        raise InvalidArgument(
            f"{field} is a {type(obstacle).__name__}; it is a Box, Cylinder or Prism",
            field,
        )
    if isinstance(obstacle, Prism):
        _count(obstacle.outline, MAX_OBSTACLE_RING, f"{field}.outline")
    check_solid(obstacle, field)


def count_points(spec: SceneSpec) -> int:
    """Number of points of all outlines; a box counts four."""
    rings = [ring for floor in spec.floors for ring in (floor.outline, *floor.holes)]
    rings += [solid.outline for solid in spec.solids if isinstance(solid, Prism)]
    return sum(map(len, rings)) + 4 * len(spec.solids)


def check_solid(solid: Solid, field: str) -> None:
    """Raises InvalidArgument unless sizes, places and outline are usable."""
    _within(solid.height, MIN_SIZE, MAX_EXTENT, f"{field}.height", Metres)
    _within(solid.bottom, -MAX_COORDINATE, MAX_COORDINATE, f"{field}.bottom", Metres)
    if isinstance(solid, Prism):
        check_ring(solid.outline, f"{field}.outline")
        return
    check_point(solid.center, f"{field}.center")
    if isinstance(solid, Cylinder):
        _within(solid.radius, MIN_SIZE / 2, MAX_EXTENT, f"{field}.radius", Metres)
        return
    if isinstance(solid, Box | Ramp):
        if len(solid.size) != 2:
            raise InvalidArgument(f"{field}.size has two numbers", f"{field}.size")
        for axis, size in enumerate(solid.size):
            _within(size, MIN_SIZE, MAX_EXTENT, f"{field}.size[{axis}]", Metres)
        _within(solid.yaw, -1e3, 1e3, f"{field}.yaw", Heading)


def check_point(point: Point2 | Point3, field: str) -> None:
    """Raises InvalidArgument unless the point has two or three finite coordinates within 10 km."""
    if len(point) not in (2, 3):
        raise InvalidArgument(
            f"{field} has {len(point)} numbers, a point is x, y or x, y, z", field
        )
    for axis, value in enumerate(point):
        _finite(value, f"{field}[{axis}]")
    if max(map(abs, point)) > MAX_COORDINATE:
        raise InvalidArgument(
            "{} is {}, allowed is at most {} from the origin along each axis",
            field,
            field,
            Place((point[0], point[1], *point[2:], 0.0)[:3]),
            Metres(MAX_COORDINATE),
        )


def check_ring(ring: Ring, field: str) -> shapely.Polygon:
    """The polygon inside a ring. Raise InvalidArgument unless it is simple and has an area."""
    _count(ring, MAX_RING, field)
    if len(ring) < 3:
        raise InvalidArgument(f"{field} has {len(ring)} points, an outline needs at least 3", field)
    for number, point in enumerate(ring):
        check_point(point, f"{field}[{number}]")
    polygon = shapely.Polygon([point[:2] for point in ring])
    if not polygon.is_valid:
        found = REASON.fullmatch(shapely.is_valid_reason(polygon))
        assert found is not None
        why, x, y = found.groups()
        raise InvalidArgument(
            "{} is no simple outline ({} at {}); it may not cross or touch itself",
            field,
            field,
            why,
            Place((float(x), float(y), 0.0)),
        )
    if polygon.area < MIN_SIZE**2:
        raise InvalidArgument(f"{field} has no area (points on one line?)", field)
    return polygon


def _check_floor(floor: Floor, field: str) -> None:
    _within(floor.height, -MAX_COORDINATE, MAX_COORDINATE, f"{field}.height", Metres)
    outer = check_ring(floor.outline, f"{field}.outline")
    _count(floor.holes, MAX_SOLIDS, f"{field}.holes")
    for number, ring in enumerate(floor.holes):
        name = f"{field}.holes[{number}]"
        if not outer.covers(check_ring(ring, name)):
            raise InvalidArgument(f"{name} reaches outside of {field}.outline", name)


def _check_mesh(mesh: MeshFile) -> None:
    if mesh.format not in ("glb", "obj", "ply"):
        raise InvalidArgument(
            f"mesh.format is {mesh.format!r}; known are glb, obj and ply", "mesh.format"
        )
    axes = np.array(mesh.axes)
    if axes.shape != (3, 3) or not np.array_equal(axes @ axes.T, np.eye(3)):
        raise InvalidArgument(
            f"mesh.axes is {mesh.axes}; it is three unit vectors at right angles", "mesh.axes"
        )
    _within(mesh.unit, *UNIT, "mesh.unit")
    if len(mesh.data) > MAX_MESH_BYTES:
        raise InvalidArgument(
            f"mesh.data has {len(mesh.data):,} bytes, at most {MAX_MESH_BYTES:,} are taken",
            "mesh.data",
        )


def _check_walkable(walkable: Walkable) -> None:
    for name, (low, high) in WALKABLE.items():
        kind: Writer = "{:g}".format if name == "slope_deg" else Metres
        _within(getattr(walkable, name), low, high, f"walkable.{name}", kind)
    if walkable.step_height >= walkable.height:
        raise InvalidArgument(
            "walkable.step_height must be below walkable.height", "walkable.step_height"
        )


def _within(
    value: float,
    low: float,
    high: float,
    field: str,
    kind: Writer = "{:g}".format,
) -> None:
    _finite(value, field)
    if not low <= value <= high:
        raise InvalidArgument(
            "{} is {}, allowed is {} to {}", field, field, kind(value), kind(low), kind(high)
        )


def _finite(value: float, field: str) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidArgument(f"{field} is {value!r}, a number is expected", field)
    if not isfinite(value):
        raise InvalidArgument(f"{field} is {'infinite' if isinf(value) else 'NaN'}", field)


def _count(items: Sequence[object], most: int, field: str) -> None:
    if len(items) > most:
        raise InvalidArgument(f"{field} has {len(items):,} items, at most {most:,}", field)
