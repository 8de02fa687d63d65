"""The entrance: a baked scene, which never changes, and its next version when an obstacle changes.

    scene = bake(SceneSpec(floors=(Floor(square),), solids=(Box(...),)))
    path = scene.path((1.0, 1.0), (18.0, 17.0))  # keeps `walkable.radius` free of walls
    scene = scene.put("crate 7", Box(...))       # a new Scene; readers of the old one lose nothing

All of it is safe to use from any number of threads. World space: metres, Z up. A point is (x, y) or
(x, y, z); z means the storey below it (see `nearest_place`), and without it the lowest one is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray

from wayfarer.errors import NotFound, ResourceExhausted, Text, Unreachable, spot
from wayfarer.navigation import baking
from wayfarer.navigation.checks import check_obstacle, check_point, check_spec
from wayfarer.navigation.clearance import REACH, ClearanceField, clearance_field
from wayfarer.navigation.grid import Grid
from wayfarer.navigation.ground.ground import Ground, find_ground, triangles
from wayfarer.navigation.locate import MeshPoint, nearest_place
from wayfarer.navigation.mesh import NavMesh
from wayfarer.navigation.obstruction import notes_on, why_apart
from wayfarer.navigation.paths.path import GroundPath
from wayfarer.navigation.roofs import roofs_of
from wayfarer.navigation.scene_spec import MAX_OBSTACLES, Obstacle, Point2, Point3, SceneSpec
from wayfarer.navigation.solids import footprint

Array = NDArray[np.floating[Any]]

FIELD_CELL: Final = 0.1
"""Metres between samples of the clearance field, more in scenes beyond `FIELD_CELLS`."""
FIELD_CELLS: Final = 2_000_000


@dataclass(frozen=True, eq=False)
class Scene:
    """One version of a scene."""

    spec: SceneSpec
    content_hash: str
    """Hash of the spec: equal specs make equal scenes (at version 0)."""
    version: int
    """0 as baked; one more with every change of an obstacle."""
    ground: Ground
    mesh: NavMesh
    fields: tuple[ClearanceField, ...]
    """One clearance field per layer of the ground."""
    obstacles: Mapping[str, Obstacle]
    open_areas: tuple[shapely.Geometry, ...]
    """Per layer: where an agent's middle may be without obstacles."""
    notes: tuple[Text, ...] = ()
    """Remarks for the level's author."""
    main_island: int = 0
    """The island where people appear by default: the largest that is no roof."""

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "obstacles": dict(self.obstacles)}  # a view cannot be pickled

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, obstacles=MappingProxyType(state["obstacles"]))

    @property
    def area(self) -> float:
        """Square metres where an agent's middle may be."""
        return float(self.mesh.areas.sum())

    @property
    def islands(self) -> int:
        """Parts of the ground with no way between them."""
        return len(self.mesh.areas)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """The ground's extent (x0, y0, x1, y1)."""
        x0, y0, x1, y1 = shapely.total_bounds([layer.own for layer in self.ground.layers])
        return float(x0), float(y0), float(x1), float(y1)

    def put(self, name: str, obstacle: Obstacle) -> "Scene":
        """The next version, in which the obstacle stands; one of the same name is moved. An equal
        one changes nothing, so a call that is sent again is answered as before.

        Only what is near is baked again. Raises InvalidArgument, ResourceExhausted, and
        FailedPrecondition when no free ground would be left.
        """
        check_obstacle(obstacle, "obstacle")
        if self.obstacles.get(name) == obstacle:
            return self
        if name not in self.obstacles and len(self.obstacles) >= MAX_OBSTACLES:
            raise ResourceExhausted(f"a scene holds at most {MAX_OBSTACLES} obstacles")
        return self._next(self.obstacles.get(name), obstacle, {**self.obstacles, name: obstacle})

    def remove(self, name: str) -> "Scene":
        """The next version, without the obstacle. Raises NotFound."""
        if name not in self.obstacles:
            raise NotFound(f"no obstacle {name!r} in the scene", "obstacle", name)
        rest = {key: value for key, value in self.obstacles.items() if key != name}
        return self._next(self.obstacles[name], None, rest)

    def path(self, start: Point2 | Point3, goal: Point2 | Point3) -> GroundPath:
        """A short way that keeps the radius free, and more around corners where there is room.

        A start or goal off the free ground is moved to the nearest free ground (for a goal: that
        can be reached), and the path gives the distance. Raises Unreachable when no way leads to a
        goal on free ground, InvalidArgument on malformed points.
        """
        from wayfarer.navigation.paths.find import shortest, widened

        first, last = self._ends(start, goal)
        points = shortest(self.mesh, self.ground, first, last)
        points = widened(points, self, self.spec.walkable.radius)
        points[:, 2] = self.floor(points)
        return GroundPath(points, first.moved, last.moved, self.version)

    def triangles(self) -> NDArray[np.float64]:
        """All its triangles, with the present obstacles [T, 3, 3], metres. Takes time."""
        return triangles(replace(self.spec, solids=(*self.spec.solids, *self.obstacles.values())))

    def reach(self, start: Point2 | Point3, goal: Point2 | Point3) -> Point3:
        """Where `path` would end, without looking for the way. Raises as it does."""
        return self._ends(start, goal)[1].point

    def nearest(self, point: Point2 | Point3) -> Point3:
        """The nearest free ground; the point itself if it is free."""
        check_point(point, "point")
        return self.place(point).point

    def island_of(self, places: Sequence[Point3]) -> int | None:
        """The island of the first place that is on one; None: none is."""
        for x, y, z in places:
            for triangle in self.mesh.under((x, y)).tolist():
                heights = self.ground.layers[self.mesh.layer[triangle]].heights
                if abs(float(heights.at(np.array([x, y]))) - z) <= self.spec.walkable.step_height:
                    return int(self.mesh.island[triangle])
        return None

    def place(self, point: Point2 | Point3) -> MeshPoint:
        """The nearest place on the navigation mesh, for a checked point."""
        return nearest_place(self.mesh, self.ground, point, self.spec.walkable)

    def is_clear(self, points: Array) -> bool:
        """Whether the polyline [P, 2 | 3] still keeps the radius free: no need to plan again."""
        from wayfarer.navigation.paths.find import sampled

        return bool(self._free(sampled(_lift(points))[0]).all())

    def floor(self, points: Array) -> Array:
        """Height of the floor at points [..., 2 | 3]; off the ground, of the nearest. [...]"""
        if len(self.fields) == 1:
            return self.ground.layers[0].heights.at(points[..., :2])
        heights = self._heights(points)
        return np.take_along_axis(heights, self._storey(points, heights)[None], 0)[0]

    def distance(self, points: Array) -> Array:
        """Metres to the nearest wall, edge or obstacle, at points [..., 2 | 3]. [...]

        Negative inside of one and off the ground; cut at ±`REACH`.
        """
        if len(self.fields) == 1:
            return self.fields[0].at(points[..., :2])
        every = np.stack([field.at(points[..., :2]) for field in self.fields])
        return np.take_along_axis(every, self._storey(points, self._heights(points))[None], 0)[0]

    def clearance(self, points: Array) -> tuple[Array, Array]:
        """`distance` [...], and the direction in which it grows [..., 2] (see ClearanceField)."""
        if len(self.fields) == 1:
            return self.fields[0].sample(points[..., :2])
        number = self._storey(points, self._heights(points))
        distance, away = np.empty(number.shape), np.empty((*number.shape, 2))
        for k in np.unique(number):
            mine = number == k
            distance[mine], away[mine] = self.fields[k].sample(points[mine][..., :2])
        return distance, away

    @property
    def _tight(self) -> float:
        """The clearance that the field may show for a way that just keeps the radius.

        In the middle of a passage the field has a ridge, which samples half a cell apart may miss.
        """
        return self.spec.walkable.radius - self.fields[0].grid.cell / 2

    def _free(self, points: Array) -> NDArray[np.bool_]:
        return self.distance(points) >= self._tight

    def _heights(self, points: Array) -> Array:
        """Height of every layer's floor at the points. [layers, ...]"""
        return np.stack([layer.heights.at(points[..., :2]) for layer in self.ground.layers])

    def _storey(self, points: Array, heights: Array) -> NDArray[np.int64]:
        """The layer of each point: the nearest in height with ground there.

        If two layers know the same ground, the one that reaches farther there owns it.
        """
        seen = np.stack([field.at(points[..., :2]) for field in self.fields])
        wanted = points[..., 2] if points.shape[-1] == 3 else heights.min(0)
        best: NDArray[np.int64] = (
            np.abs(heights - wanted) - np.where(seen < 0, seen, 0.1 * seen)
        ).argmin(0)
        return best

    def _ends(self, start: Point2 | Point3, goal: Point2 | Point3) -> tuple[MeshPoint, MeshPoint]:
        check_point(start, "start")
        check_point(goal, "goal")
        first, last = self.place(start), self.place(goal)
        island = self.mesh.island[first.triangle]
        if self.mesh.island[last.triangle] == island:
            return first, last
        reachable = np.flatnonzero(self.mesh.island == island)
        nearest = nearest_place(self.mesh, self.ground, goal, self.spec.walkable, reachable)
        if not last.moved:
            apart = int(island), int(self.mesh.island[last.triangle])
            raise Unreachable(
                "no way leads to {}; the nearest place that can be reached is {}",
                nearest.point,
                spot(last.point),
                spot(nearest.point),
                look=lambda: why_apart(self, *apart),
            )
        return first, nearest

    def standing(self, number: int, near: shapely.Geometry) -> list[shapely.Geometry]:
        """Outlines of the obstacles that are in the way on a layer, near an area."""
        layer, walkable = self.ground.layers[number], self.spec.walkable
        shapes = [
            footprint(o) for o in self.obstacles.values() if baking.blocks(o, layer, walkable)
        ]
        return [shape for shape in shapes if near.intersects(shape)]

    def _next(
        self, old: Obstacle | None, new: Obstacle | None, obstacles: dict[str, Obstacle]
    ) -> "Scene":
        """The version after `old` left and `new` came."""
        scene = replace(self, version=self.version + 1, obstacles=MappingProxyType(obstacles))
        for number in range(len(self.ground.layers)):
            scene = scene._relaid(number, old, new)
        return replace(scene, main_island=_main_island(scene))

    def _relaid(self, number: int, old: Obstacle | None, new: Obstacle | None) -> "Scene":
        """The same version with one layer's mesh and field repaired around the change."""
        layer, walkable = self.ground.layers[number], self.spec.walkable
        left, came = (
            [footprint(o)] if o is not None and baking.blocks(o, layer, walkable) else []
            for o in (old, new)
        )
        if not left and not came:
            return self
        bounds = tuple(shapely.total_bounds([*left, *came]).tolist())
        near = shapely.box(*bounds).buffer(3 * REACH)
        standing = self.standing(number, near)
        opened, closed, others = (
            baking.grown(shapely.union_all(shapes), walkable.radius)
            for shapes in (left, came, standing)
        )
        mesh = baking.repair(
            self.mesh,
            number,
            self.open_areas[number],
            opened,
            closed,
            others,
            baking.slack_of(self.ground),
        )
        free = shapely.difference(
            shapely.clip_by_rect(layer.ground, *near.bounds), shapely.union_all(standing)
        )
        fields = list(self.fields)
        fields[number] = fields[number].changed(free, bounds)
        return replace(self, mesh=mesh, fields=tuple(fields))


def bake(spec: SceneSpec) -> Scene:
    """Checks a scene and bakes it. Raises InvalidArgument, which names the field."""
    check_spec(spec)
    ground = find_ground(spec)
    open_areas = tuple(baking.open_ground(layer, spec.walkable.radius) for layer in ground.layers)
    mesh = baking.bake_mesh(spec, ground, open_areas)
    open_areas = tuple(baking.within(mesh, k, area) for k, area in enumerate(open_areas))
    fields = tuple(_field(layer.ground) for layer in ground.layers)
    hashed, none = spec.content_hash, MappingProxyType[str, Obstacle]({})
    scene = Scene(spec, hashed, 0, ground, mesh, fields, none, open_areas)
    notes = *ground.notes, *notes_on(scene)
    return replace(scene, notes=notes, main_island=_main_island(scene))


def _main_island(scene: Scene) -> int:
    """Found when a scene is made or changed, which the motion thread does not wait for."""
    roofs = np.zeros(scene.islands, bool)
    roofs[[roof.island for roof in roofs_of(scene.mesh, scene.ground)]] = True
    return int(np.where(roofs & ~roofs.all(), -1.0, scene.mesh.areas).argmax())


def _field(ground: shapely.Geometry) -> ClearanceField:
    x0, y0, x1, y1 = ground.bounds
    cell = max(FIELD_CELL, ((x1 - x0) * (y1 - y0) / FIELD_CELLS) ** 0.5)
    return clearance_field(ground, Grid.over((x0, y0, x1, y1), cell, margin=1.0))


def _lift(points: Array) -> Array:
    if points.shape[-1] == 3:
        return points
    return np.column_stack([points, np.zeros(len(points))])
