"""Feet that are lifted and set down by formula."""

import numpy as np
import pytest

from tests.lab.evaluation.metrics.motions import bump, ramp
from wayfarer.spec import FPS
from wayfarer_lab.evaluation.metrics import feet, footwork

FRAMES = 200


def steps() -> tuple[np.ndarray, np.ndarray]:
    """Ankles [T, 2, 3] and heights [T, 2]: left goes .5 m from frame 40 on, right .4 from 100."""
    ankles, height = np.zeros((FRAMES, 2, 3)), np.zeros((FRAMES, 2))
    for foot, start, way in ((0, 40, 0.5), (1, 100, 0.4)):
        height[:, foot] = bump(FRAMES, start, 20, 0.06)
        ankles[:, foot, 1] = ramp(FRAMES, start, start + 20, way)
    return ankles, height


def test_ways_of_feet_are_from_lift_to_landing() -> None:
    ankles, height = steps()
    assert footwork.lift_ways(ankles, height) == pytest.approx([0.5, 0.4], abs=0.08)
    assert footwork.lift_ways(ankles, 0 * height) == [], "a glide is no step"


def test_lifts_for_a_metre_a_second_and_a_quarter_turn() -> None:
    _, height = steps()
    hips = np.zeros((FRAMES, 3))
    hips[:, 1] = ramp(FRAMES, 0, FRAMES - 1, 0.8)
    assert footwork.travelled(hips) == pytest.approx(0.8, rel=0.02)
    assert footwork.lifts_per_metre(hips, height) == pytest.approx(2.5, rel=0.02)
    assert np.isnan(footwork.lifts_per_metre(0 * hips, height)), "goes nowhere"
    assert footwork.lifts_per_second(height) == pytest.approx(2 * FPS / FRAMES)
    assert footwork.lifts_per_quarter(ramp(FRAMES, 0, 100, -180.0), height) == pytest.approx(1)
    assert np.isnan(footwork.lifts_per_quarter(np.zeros(FRAMES), height))


def test_a_turntable_turns_its_feet_all_the_way() -> None:
    heading = ramp(FRAMES, 50, 100, 90.0)
    whole = [feet.Stance(foot, 0, FRAMES, 0.0, 90.0) for foot in (0, 1)]
    assert footwork.floor_turn_share(heading, whole) == pytest.approx(1)
    assert footwork.floor_turn_share(heading, []) == 0


def test_a_head_leads_the_way_of_the_turn() -> None:
    heading = ramp(FRAMES, 50, 150, -90.0)
    ahead = -bump(FRAMES, 40, 60, 25.0)
    assert footwork.lead(ahead, heading) == pytest.approx(25, rel=0.01)
    assert footwork.lead(-ahead, heading) == pytest.approx(0, abs=1e-9)
    late = -bump(FRAMES, 120, 60, 25.0)
    assert footwork.lead(late, heading) == pytest.approx(0, abs=1e-9)


def test_knees_in_support_are_those_of_the_foot_that_bears_alone() -> None:
    _, height = steps()
    knees = np.full((FRAMES, 2), 5.0)
    knees[:, 1][height[:, 0] > feet.LIFTED] = 20.0
    knees[:, 0][height[:, 1] > feet.LIFTED] = 30.0
    assert footwork.knees_in_support(knees, height) == pytest.approx(25, abs=5.1)
    assert np.isnan(footwork.knees_in_support(knees, 0 * height))


def test_the_weight_is_shifted_before_a_foot_is_up() -> None:
    _, height = steps()
    hips = np.zeros((FRAMES, 3))
    hips[:, 0] = ramp(FRAMES, 20, 60, 0.1)  # half a second before frame 40
    assert footwork.seconds_before_lift(hips, height) == pytest.approx(0.55, abs=0.1)
    assert footwork.seconds_before_lift(0 * hips, height) == 0
    assert np.isnan(footwork.seconds_before_lift(hips, 0 * height))


def test_footfalls() -> None:
    _, height = steps()
    assert footwork.footfalls(height) == 2 and footwork.footfalls(height[:110]) == 1
