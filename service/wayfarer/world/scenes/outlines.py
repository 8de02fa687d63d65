"""The shapes of a scene for drawing."""

from typing import Final

import numpy as np
import shapely

from wayfarer.navigation.scene import Scene
from wayfarer.navigation.scene_spec import Obstacle, Point3, Ramp, Ring, Solid
from wayfarer.navigation.solids import footprint
from wayfarer.world.scenes.messages import Block, Outlines

_UPHILL: Final = (0.0, 0.0, 1.0, 1.0)
"""Height of a ramp's corners, in the order of its footprint."""


def outlines(scene: Scene) -> Outlines:
    """The ground for agents' middles, and the solids. Takes time in large scenes."""
    vertices, triangles = _floor(scene)
    return Outlines(
        walkable=_walkable(scene),
        vertices=vertices,
        triangles=triangles,
        solids=tuple(map(_block, scene.spec.solids)),
        obstacles={name: _block(obstacle) for name, obstacle in scene.obstacles.items()},
        version=scene.version,
    )


def _walkable(scene: Scene) -> tuple[tuple[Ring, ...], ...]:
    """Polygons: the union of the triangles of each layer."""
    triangles = shapely.polygons(scene.mesh.corners)
    found = []
    for number in np.unique(scene.mesh.layer):
        union = shapely.union_all(triangles[scene.mesh.layer == number])
        for polygon in shapely.get_parts(union):
            if isinstance(polygon, shapely.Polygon):
                rings = (polygon.exterior, *polygon.interiors)
                found.append(tuple(_ring(ring) for ring in rings))
    return tuple(found)


def _floor(scene: Scene) -> tuple[tuple[Point3, ...], tuple[tuple[int, int, int], ...]]:
    """The mesh on the floor: corners shared by triangles of a layer are one vertex."""
    corners = scene.mesh.corners
    heights = np.empty(corners.shape[:2])
    for number in np.unique(scene.mesh.layer):
        mine = scene.mesh.layer == number
        heights[mine] = scene.ground.layers[number].heights.at(corners[mine])
    every = np.concatenate([corners, heights[..., None]], -1).reshape(-1, 3).round(4)
    vertices, index = np.unique(every, axis=0, return_inverse=True)
    return (
        tuple((x, y, z) for x, y, z in vertices.tolist()),
        tuple((a, b, c) for a, b, c in index.reshape(-1, 3).tolist()),
    )


def _block(solid: Solid | Obstacle) -> Block:
    ring = _ring(footprint(solid).exterior)
    heights = _UPHILL if isinstance(solid, Ramp) else (1.0,) * len(ring)
    top = solid.bottom + solid.height * np.array(heights)
    return Block(
        tuple((x, y, z) for (x, y), z in zip(ring, top.tolist(), strict=True)), solid.bottom
    )


def _ring(line: shapely.LinearRing) -> Ring:
    return tuple((x, y) for x, y in shapely.get_coordinates(line)[:-1].tolist())
