"""The ground of a scene, before any radius: layers of polygons with heights.

A flat scene (level floors of one height, nothing on them low enough to step on) keeps its exact
outlines. All others go through a grid of cells of 5 cm, larger beyond some 70 x 70 m (at most
35 cm, at 500 x 500 m). Outlines may be off by a cell, mostly to the safe side. A gap is lost when
it is less than two cells wider than an agent.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument, Metres, Text
from wayfarer.navigation.checks import count_points
from wayfarer.navigation.grid import Grid
from wayfarer.navigation.ground.barriers import HIGHEST, LOWEST, Barrier, barriers
from wayfarer.navigation.ground.layers import ISLAND_SHARE, outline, sheets
from wayfarer.navigation.ground.levels import floors
from wayfarer.navigation.meshes.read import read_level
from wayfarer.navigation.scene_spec import MAX_EXTENT, Ramp, SceneSpec
from wayfarer.navigation.solids import (
    at_height,
    floor_polygon,
    footprint,
    solid_triangles,
    triangulate,
)

Array = NDArray[np.floating[Any]]

FINEST_CELL: Final = 0.05
MAX_CELLS: Final = 2_000_000
MAX_EXACT_POINTS: Final = 1_500
MAX_EXACT_CORNERS: Final = 20_000
"""Flat scenes of more detail go through cells: crossings of outlines may grow with the square of
their number, cells do not."""
MAX_CORNERS: Final = 50_000


@dataclass(frozen=True, slots=True)
class Heights:
    """Heights of a layer's floor: one number, or sampled (float32 [rows, columns])."""

    level: float
    grid: Grid | None = None
    values: NDArray[np.float32] | None = None
    ledge: float = 0.0
    """Cells that differ by more are a step, and no slope to interpolate on."""

    def at(self, points: Array) -> Array:
        """Heights [...] at points [..., 2]; beyond the ground, that of the nearest ground."""
        if self.grid is None or self.values is None:
            return np.full(points.shape[:-1], self.level)
        places = np.clip(
            self.grid.places(points), 0, (self.grid.columns - 1.001, self.grid.rows - 1.001)
        )
        corner = places.astype(int)
        x, y = np.moveaxis(places - corner, -1, 0)
        column, row = np.moveaxis(corner, -1, 0)
        around = np.stack([self.values[row + k, column + j] for k in (0, 1) for j in (0, 1)])
        weight = np.stack([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y])
        smooth = around.max(0) - around.min(0) <= self.ledge
        nearest = np.take_along_axis(around, weight.argmax(0)[None], 0)[0]
        return np.where(smooth, (around * weight).sum(0), nearest.astype(np.float64))


@dataclass(frozen=True, slots=True)
class Layer:
    """Ground that covers a point of the plan at most once.

    `own`: the part of this layer alone; `ground`: also surroundings that other
    layers continue, so that a border between layers is no wall.
    """

    own: shapely.Geometry
    ground: shapely.Geometry
    heights: Heights


@dataclass(frozen=True, slots=True)
class Ground:
    """All layers, lowest first. `cell`: metres that outlines may be off; 0: exact.

    `notes`: remarks for the level's author. `barriers`: what separates parts of its ground.
    """

    layers: tuple[Layer, ...]
    cell: float
    notes: tuple[Text, ...] = ()
    barriers: tuple[Barrier, ...] = ()
    size: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Size of a level's mesh along x, y and z, metres; 0 without one."""


def find_ground(spec: SceneSpec) -> Ground:
    """The ground of a checked scene. Raises InvalidArgument."""
    ground = _flat(spec) if _is_flat(spec) else None
    if ground is None or _corners(ground) > MAX_EXACT_CORNERS:
        ground = _sampled(spec)
    if _corners(ground) > MAX_CORNERS:
        raise InvalidArgument(
            f"the ground's outlines have {_corners(ground):,} corners, at most {MAX_CORNERS:,}",
            "mesh.data" if spec.mesh else "solids",
        )
    if all(layer.own.is_empty for layer in ground.layers):
        raise InvalidArgument(
            "nobody can stand anywhere in this scene: no ground is flat enough and free up to "
            "{} (is the up axis right?)" + size_pattern(spec, ground),
            "mesh.data" if spec.mesh else "floors",
            Metres(spec.walkable.height),
            *size_parts(ground),
        )
    return ground


def size_pattern(spec: SceneSpec, ground: Ground) -> str:
    """The part of an error that gives the size and the orientation of a level's mesh."""
    if spec.mesh is None:
        return ""
    notes = "".join(f"; {note.pattern}" for note in ground.notes if not note.parts)
    return (
        "; the level is {} x {} and {} high (is mesh.unit, "
        f"{spec.mesh.unit:g} m, right?){notes}"
    )


def size_parts(ground: Ground) -> tuple[Metres, ...]:
    """The lengths in that text."""
    return tuple(Metres(float(f"{length:.2g}")) for length in ground.size if ground.size[0])


def _corners(ground: Ground) -> int:
    return sum(int(shapely.get_num_coordinates(layer.own)) for layer in ground.layers)


def _is_flat(spec: SceneSpec) -> bool:
    if spec.mesh is not None or len({floor.height for floor in spec.floors}) != 1:
        return False
    if count_points(spec) > MAX_EXACT_POINTS:
        return False
    level, walkable = spec.floors[0].height, spec.walkable
    return all(
        not isinstance(solid, Ramp)
        and (
            solid.bottom + solid.height <= level
            or solid.bottom >= level + walkable.height
            or solid.bottom + solid.height > level + walkable.step_height
        )
        for solid in spec.solids
    )


def _flat(spec: SceneSpec) -> Ground:
    level = spec.floors[0].height
    in_the_way = [
        footprint(solid)
        for solid in spec.solids
        if solid.bottom + solid.height > level and solid.bottom < level + spec.walkable.height
    ]
    floor = shapely.union_all([floor_polygon(f) for f in spec.floors])
    _check_extent(floor.bounds)
    free = shapely.difference(floor, shapely.union_all(in_the_way))
    layer = Layer(free, free, Heights(level))
    return Ground((layer,), 0.0, barriers=_barriers_of_flat(spec, level, free))


def _barriers_of_flat(spec: SceneSpec, level: float, free: shapely.Geometry) -> tuple[Barrier, ...]:
    """Barriers of a flat scene: only below solids in the air, or over low ones."""
    walkable = spec.walkable
    above = [solid.bottom - level for solid in spec.solids]
    tops = [solid.bottom + solid.height - level for solid in spec.solids]
    low = any(LOWEST * walkable.height <= room < walkable.height for room in above)
    high = any(walkable.step_height < top <= HIGHEST for top in tops)
    areas = shapely.area(shapely.get_parts(free))
    parted = (areas >= ISLAND_SHARE * areas.max(initial=0.0)).sum() > 1
    if not low and not (high and parted):
        return ()
    corners, _ = _corners_of(spec)
    grid = _grid_over(corners)
    found = floors(corners, grid, walkable)
    return tuple(barriers(corners, grid, found, walkable, ISLAND_SHARE))


def triangles(spec: SceneSpec) -> NDArray[np.float64]:
    """All triangles of a scene [T, 3, 3], metres. Raises InvalidArgument for a bad mesh."""
    return _corners_of(spec)[0]


def _corners_of(spec: SceneSpec) -> tuple[NDArray[np.float64], tuple[Text, ...]]:
    """All triangles of a scene, and remarks about the level's mesh."""
    level, notes = (
        read_level(spec.mesh, spec.walkable, spec.entries)
        if spec.mesh
        else (np.empty((0, 3, 3)), [])
    )
    others = [
        *(at_height(triangulate(floor_polygon(f)), f.height) for f in spec.floors),
        *(solid_triangles(solid) for solid in spec.solids),
    ]
    return np.concatenate([level, *others]), tuple(notes)


def _grid_over(corners: NDArray[np.float64]) -> Grid:
    low, high = corners.min((0, 1)), corners.max((0, 1))
    bounds = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    _check_extent(bounds)
    cell = max(FINEST_CELL, sqrt((high[0] - low[0]) * (high[1] - low[1]) / MAX_CELLS))
    return Grid.over(bounds, cell, 3 * cell)


def _sampled(spec: SceneSpec) -> Ground:
    corners, notes = _corners_of(spec)
    grid, walkable = _grid_over(corners), spec.walkable
    cell = grid.cell
    found = floors(corners, grid, walkable)
    places = found.stands(found.room >= walkable.height, walkable.step_height)
    parted = barriers(corners, grid, found, walkable, ISLAND_SHARE)
    x, y, z = (float(length) for length in np.ptp(corners.reshape(-1, 3), axis=0))
    layers = []
    for sheet in sheets(places, spec.entries, spec.walkable):
        own = outline(sheet.own, grid)
        alone = (sheet.own == sheet.around).all()
        ground = own if alone else outline(sheet.around, grid)
        heights = Heights(0.0, grid, sheet.height, ledge=max(0.04, 1.2 * cell))
        layers.append(Layer(own, ground, heights))
    return Ground(tuple(layers), cell, notes, tuple(parted), (x, y, z) if spec.mesh else (0, 0, 0))


def _check_extent(bounds: tuple[float, float, float, float]) -> None:
    width, depth = bounds[2] - bounds[0], bounds[3] - bounds[1]
    if max(width, depth) > MAX_EXTENT:
        raise InvalidArgument(
            "the scene is {} x {}, at most {} either side (is mesh.unit right?)",
            "mesh.data",
            Metres(round(width)),
            Metres(round(depth)),
            Metres(MAX_EXTENT),
        )
