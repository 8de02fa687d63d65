"""Judging goal runs whose course is known."""

import math

import numpy as np
import pytest

from wayfarer.evaluation.outcome import STEP_LIMIT, goal_row, judge
from wayfarer.spec import FPS, NEW_FRAMES

FRAMES = STEP_LIMIT * NEW_FRAMES + 15 * FPS
GOAL = np.array([0.0, 4.0, 0.0])


def approach(speed: float, stop_at: float) -> np.ndarray:
    """Hips that walk along Y at `speed` m/s to y = `stop_at` and stay there."""
    y = np.minimum(np.arange(1, FRAMES + 1) / FPS * speed, stop_at)
    return np.stack([np.zeros(FRAMES), y, np.full(FRAMES, 0.9)], -1)


def test_a_walk_to_the_goal() -> None:
    hips = approach(1.0, 3.9)
    standing = hips[:, 1] >= 3.9
    outcome = judge(hips, standing, GOAL)
    assert outcome.reached == pytest.approx(3.25 * FPS, abs=1)
    assert outcome.steps == 17, "3.25 s are 16.25 steps of 0.2 s: the goal is reached in the 17th"
    assert outcome.near
    assert outcome.final_distance == pytest.approx(0.1)
    assert outcome.stopped == pytest.approx(3.9 * FPS, abs=1)
    assert outcome.arrival_error == pytest.approx(0.1)
    assert outcome.drift == 0.0
    assert outcome.walking() == slice(0, outcome.reached)
    assert outcome.standing() == slice(outcome.stopped + FPS, outcome.stopped + 5 * FPS)


def test_one_who_comes_too_late_has_not_reached_it() -> None:
    outcome = judge(approach(0.2, 4.0), np.zeros(FRAMES, bool), GOAL)
    assert outcome.reached is None and outcome.stopped is None and outcome.standing() is None
    assert math.isnan(outcome.steps)
    assert outcome.final_distance == pytest.approx(4.0 - 0.2 * 12, abs=0.02)
    assert outcome.walking() == slice(0, STEP_LIMIT * NEW_FRAMES)


def test_passing_within_075_but_not_within_03() -> None:
    hips = approach(1.0, 99.0) + np.array([0.5, 0.0, 0.0])
    outcome = judge(hips, np.zeros(FRAMES, bool), GOAL)
    assert outcome.reached is not None and not outcome.near
    assert outcome.stopped is None


def test_standing_before_the_goal_is_no_arrival() -> None:
    outcome = judge(approach(1.0, 2.0), np.ones(FRAMES, bool), GOAL)
    assert outcome.reached is None and outcome.stopped is None


def test_drift_is_the_farthest_place_in_five_seconds() -> None:
    hips = approach(1.0, 3.9)
    standing = hips[:, 1] >= 3.9
    begin = int(np.flatnonzero(standing)[0])
    hips[begin + 100, 0] = 0.6  # within five seconds, and back again
    hips[begin + 250, 0] = 5.0  # later: not watched
    assert judge(hips, standing, GOAL).drift == pytest.approx(0.6)


def test_a_stand_that_cannot_be_watched_does_not_count() -> None:
    standing = np.zeros(FRAMES, bool)
    standing[-100:] = True
    assert judge(approach(1.0, 3.9), standing, GOAL).stopped is None


def test_rows_average_over_the_runs_in_which_it_happened() -> None:
    good = approach(1.0, 3.9)
    outcomes = [
        judge(good, good[:, 1] >= 3.9, GOAL),
        judge(approach(0.2, 4.0), np.zeros(FRAMES, bool), GOAL),
    ]
    row = goal_row("two", outcomes)
    assert row["runs"] == 2
    assert row["success_075m"] == 0.5 and row["stopped"] == 0.5
    assert row["steps"] == 17 and row["arrival_error_m"] == pytest.approx(0.1)
    assert row["final_distance_m"] == pytest.approx((0.1 + 1.6) / 2, abs=0.02)
    assert row["stays_within_05m"] == 1.0


def test_rows_of_failures_only_have_no_averages() -> None:
    row = goal_row("none", [judge(approach(0.2, 4.0), np.zeros(FRAMES, bool), GOAL)])
    assert row["success_075m"] == 0.0
    assert math.isnan(float(row["steps"])) and math.isnan(float(row["drift_5s_max_m"]))
