"""Places in a scene: drawn at random, and moved to free ground."""

import numpy as np

from wayfarer.navigation.scene import Scene
from wayfarer.navigation.scene_spec import Point2, Point3
from wayfarer.world.rows import Array


def island_at(scene: Scene, point: Point2 | Point3) -> int:
    """The island of the free ground nearest to a point."""
    return int(scene.mesh.island[scene.place(point).triangle])


def drawn_places(scene: Scene, island: int, draws: Array) -> Array:
    """Places [N, 3] spread evenly over an island, from uniform numbers [N, 3] in [0, 1)."""
    mesh = scene.mesh
    triangles = np.flatnonzero(mesh.island == island)
    corners = mesh.corners[triangles]
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    upto = np.cumsum(np.abs(ax * by - ay * bx))
    which = np.searchsorted(upto, draws[:, 0] * upto[-1], side="right")
    which = np.minimum(which, len(triangles) - 1)
    root = np.sqrt(draws[:, 1:2])
    a, b, c = corners[which].swapaxes(0, 1)
    spots = (1 - root) * a + root * (1 - draws[:, 2:]) * b + root * draws[:, 2:] * c
    heights = np.empty(len(spots))
    layers = mesh.layer[triangles[which]]
    for number in np.unique(layers).tolist():
        mine = layers == number
        heights[mine] = scene.ground.layers[number].heights.at(spots[mine])
    return np.column_stack([spots, heights])


def free_place(scene: Scene | None, place: Point3) -> Point3:
    """The place, or the free ground nearest to it."""
    if scene is None or scene.distance(np.array([place]))[0] >= scene.spec.walkable.radius:
        return place
    return scene.nearest(place)
