"""Pairs of start and goal that a path connects, and the shortest possible way between them.

That is found by a visibility graph: slow, for measuring what `Scene.path` finds.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from wayfarer.errors import Unreachable
from wayfarer.navigation.scene import Scene
from wayfarer.navigation.scene_spec import Point2

Pair = tuple[Point2, Point2]

MIN_DISTANCE = 1.0
"""Least distance in metres: nearer goals do not test a path."""


def random_pairs(scene: Scene, count: int, random: np.random.Generator) -> list[Pair]:
    """Free points anywhere in the scene, each with another point that it can reach."""
    x0, y0, x1, y1 = scene.bounds
    pairs: list[Pair] = []
    while len(pairs) < count:
        a, b = (tuple(p) for p in random.uniform((x0, y0), (x1, y1), (2, 2)).tolist())
        try:
            path = scene.path(a, b)
        except Unreachable:
            continue
        if path.start_moved == path.goal_moved == 0 and path.length > MIN_DISTANCE:
            pairs.append((a, b))
    return pairs


Array = NDArray[np.floating[Any]]

_SLACK: Final = 1e-6
"""Metres by which a line may leave the free ground: it runs along its outline."""


def shortest_lengths(scene: Scene, pairs: Sequence[tuple[Point2, Point2]]) -> Array:
    """Metres of the shortest way between each pair of free points; inf where there is none. [n]

    Corners of the free ground see each other if the straight line between them is free: quadratic
    in the corners. One layer only.
    """
    free = shapely.union_all(shapely.polygons(scene.mesh.corners))
    corners = np.unique(shapely.get_coordinates(free), axis=0)
    ends = np.array([end[:2] for pair in pairs for end in pair])
    spots = np.concatenate([ends, corners])
    room = shapely.buffer(free, _SLACK)
    shapely.prepare(room)
    one, other = np.triu_indices(len(spots), 1)
    sees = shapely.covers(room, shapely.linestrings(np.stack([spots[one], spots[other]], 1)))
    one, other = one[sees], other[sees]
    metres = np.maximum(np.linalg.norm(spots[one] - spots[other], axis=1), 1e-12)
    graph = coo_array((metres, (one, other)), shape=(len(spots), len(spots))).tocsr()
    starts = np.arange(0, len(ends), 2)
    every = dijkstra(graph, directed=False, indices=starts)
    lengths: Array = every[np.arange(len(pairs)), starts + 1]
    return lengths
