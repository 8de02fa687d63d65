"""Pairs of start and goal that a path connects."""

import numpy as np

from wayfarer.errors import Unreachable
from wayfarer.navigation.scene import Scene
from wayfarer.navigation.scene_spec import Point2

Pair = tuple[Point2, Point2]

SHORTEST = 1.0
"""Least distance in metres: nearer goals do not test a path."""


def random_pairs(scene: Scene, count: int, random: np.random.Generator) -> list[Pair]:
    """Free points anywhere in the scene, each with another one that can be reached from it."""
    x0, y0, x1, y1 = scene.bounds
    pairs: list[Pair] = []
    while len(pairs) < count:
        a, b = (tuple(p) for p in random.uniform((x0, y0), (x1, y1), (2, 2)).tolist())
        try:
            path = scene.path(a, b)
        except Unreachable:
            continue
        if path.start_moved == path.goal_moved == 0 and path.length > SHORTEST:
            pairs.append((a, b))
    return pairs
