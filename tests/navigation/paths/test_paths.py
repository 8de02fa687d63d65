"""Paths on random fields, against brute force and against the geometry itself."""

from math import dist

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfarer.errors import Unreachable
from wayfarer.navigation.examples import cubes_field
from wayfarer.navigation.paths.path import GroundPath
from wayfarer.navigation.scene import Scene, bake
from wayfarer_lab.evaluation.scenes.pairs import shortest_lengths

SCENES = [bake(cubes_field(seed, boxes=20, side=14.0)) for seed in range(3)]
scenes = st.sampled_from(SCENES)
spots = st.tuples(st.floats(0, 14), st.floats(0, 14))


def path_or_none(
    scene: Scene, start: tuple[float, float], goal: tuple[float, float]
) -> GroundPath | None:
    try:
        return scene.path(start, goal)
    except Unreachable:
        return None


@settings(max_examples=80, deadline=None)
@given(scenes, spots, spots)
def test_paths_keep_the_radius_from_every_wall(
    scene: Scene, start: tuple[float, float], goal: tuple[float, float]
) -> None:
    path = path_or_none(scene, start, goal)
    if path is None or len(path.points) < 2:
        return
    line = shapely.LineString(path.points[:, :2])
    walls = shapely.boundary(scene.ground.layers[0].ground)
    assert shapely.distance(line, walls) > scene.spec.walkable.radius - 2e-3
    assert scene.is_clear(path.points)


@settings(max_examples=80, deadline=None)
@given(scenes, spots, spots)
def test_paths_join_what_was_asked_for_and_are_as_long_there_as_back(
    scene: Scene, start: tuple[float, float], goal: tuple[float, float]
) -> None:
    path = path_or_none(scene, start, goal)
    if path is None:
        return
    assert dist(path.points[0, :2], start) == pytest.approx(path.start_moved, abs=1e-9)
    assert dist(path.points[-1, :2], goal) == pytest.approx(path.goal_moved, abs=1e-9)
    assert path.length >= dist(path.points[0, :2], path.points[-1, :2]) - 1e-9
    if path.start_moved == path.goal_moved == 0:
        assert scene.path(goal, start).length == pytest.approx(path.length, rel=1e-3)


@pytest.mark.parametrize("scene", SCENES)
def test_paths_are_hardly_longer_than_the_shortest(scene: Scene) -> None:
    random = np.random.default_rng(5)
    island = np.flatnonzero(scene.mesh.island == scene.mesh.areas.argmax())
    middles = scene.mesh.corners[island].mean(1)
    ends = [tuple(p) for p in middles[random.integers(0, len(middles), (80,))].tolist()]
    pairs = list(zip(ends[::2], ends[1::2], strict=True))
    best = shortest_lengths(scene, pairs)
    found = np.array([scene.path(*pair).length for pair in pairs])
    far = best > 1.0
    ratio = found[far] / best[far]
    assert ratio.min() > 1 - 1e-6
    assert np.quantile(ratio, 0.95) < 1.05 and ratio.mean() < 1.03


def test_corners_are_kept_clear_of_where_there_is_room() -> None:
    scene = SCENES[0]
    pairs = [((1.0, 1.0), (13.0, 13.0)), ((1.0, 13.0), (13.0, 1.0))]
    gained = []
    for pair in pairs:
        points = scene.path(*pair).points[1:-1]
        gained += (scene.distance(points) - scene.spec.walkable.radius).tolist()
    assert max(gained) > 0.08


def test_a_path_of_one_point_is_a_path() -> None:
    path = SCENES[0].path((1.0, 1.0), (1.0, 1.0))
    assert path.length == 0 and path.goal == (1.0, 1.0, 0.0)
    assert SCENES[0].is_clear(path.points)
