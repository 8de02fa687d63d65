"""Capsules in each other."""

import numpy as np
import pytest

from wayfarer_lab.evaluation.scenes.overlap import overlaps, segment_distance


def test_segment_distance_is_that_of_the_nearest_points() -> None:
    random = np.random.default_rng(0)
    a, b, c, d = random.normal(size=(4, 100, 3))
    share = np.linspace(0, 1, 101)[:, None]
    one = a[:, None] + share * (b - a)[:, None]
    other = c[:, None] + share * (d - c)[:, None]
    sampled = np.linalg.norm(one[:, :, None] - other[:, None], axis=-1).min((1, 2))
    found = segment_distance(a, b, c, d)
    assert (found <= sampled + 1e-9).all() and (sampled - found < 0.02).all()


def test_points_and_parallels_are_segments_too() -> None:
    o, x, y = np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    assert segment_distance(o, o, x, x) == pytest.approx(1.0)
    assert segment_distance(o, x, y, x + y) == pytest.approx(1.0)
    assert segment_distance(o, x, 3 * x, 3 * x + y) == pytest.approx(2.0)


def posts(*places: tuple[float, float], frames: tuple[int, ...]) -> tuple:
    """Upright capsules of 1 m and a radius of 0.2 m."""
    hips = np.array([[x, y, 0.5] for x, y in places])
    lift = np.array([0, 0, 0.5])
    radius = np.full((len(places), 1), 0.2)
    return np.array(frames), hips, (hips - lift)[:, None], (hips + lift)[:, None], radius


def test_depth_is_how_far_they_are_in_each_other() -> None:
    one, other, depth = overlaps(*posts((0, 0), (0.3, 0), (2, 0), frames=(7, 7, 7)))
    assert {int(one[0]), int(other[0])} == {0, 1} and len(one) == 1
    assert depth == pytest.approx([0.1])


def test_only_bodies_of_the_same_frame_meet() -> None:
    one, _, _ = overlaps(*posts((0, 0), (0.1, 0), frames=(1, 2)))
    assert not len(one)
    one, _, _ = overlaps(*posts((0, 0), frames=(1,)))
    assert not len(one)
