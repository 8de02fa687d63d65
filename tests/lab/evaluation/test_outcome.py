"""Judging goal runs whose trajectory is known."""

import math

import numpy as np
import pytest

from tests.lab.evaluation.people import line, trajectory
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.outcome import STEP_LIMIT, goal_outcome, goal_row
from wayfarer_lab.evaluation.tasks import Trajectory

FRAMES = STEP_LIMIT * NEW_FRAMES + 15 * FPS
GOAL = Goal((0.0, 4.0, 0.0))


def metres(speed: float, stop_at: float) -> np.ndarray:
    return np.minimum(np.arange(1, FRAMES + 1) / FPS * speed, stop_at)


def walk(speed: float, stop_at: float, goal: Goal = GOAL, heading: float = 0.0) -> Trajectory:
    """Along Y at `speed` m/s to y = `stop_at`, and standing there."""
    y = metres(speed, stop_at)
    return trajectory(line(y), goal, heading, standing=y >= stop_at)


def test_a_walk_to_the_goal() -> None:
    outcome = goal_outcome(walk(1.0, 3.9))
    assert outcome.reached == pytest.approx(3.25 * FPS, abs=1)
    assert outcome.steps == 17, "3.25 s are 16.25 steps of 0.2 s: the goal is reached in the 17th"
    assert outcome.near == pytest.approx(3.7 * FPS, abs=1)
    assert outcome.final_distance == pytest.approx(0.1)
    assert outcome.stopped == pytest.approx(3.9 * FPS, abs=1)
    assert outcome.seconds_to_stand == pytest.approx(0.65, abs=0.05)
    assert outcome.arrival_error == pytest.approx(0.1)
    assert outcome.drift_2s == outcome.drift_5s == 0.0
    assert math.isnan(outcome.facing_error), "no heading was asked for"
    assert outcome.walking() == slice(0, outcome.reached)
    assert outcome.standing() == slice(outcome.stopped + FPS, outcome.stopped + 5 * FPS)


def test_frames_count_from_the_order() -> None:
    before = np.zeros(100)
    way = line(np.concatenate([before, metres(1.0, 3.9)]))
    assert (
        goal_outcome(trajectory(way, GOAL, frame=100)).reached
        == goal_outcome(walk(1.0, 3.9)).reached
    )


@pytest.mark.parametrize("asked", [0.5, 0.5 - 2 * np.pi])
def test_the_facing_counts_when_it_is_asked_for(asked: float) -> None:
    goal = Goal((0.0, 4.0, 0.0), heading=asked)
    assert goal_outcome(walk(1.0, 3.9, goal, 0.3)).facing_error == pytest.approx(
        np.degrees(0.2), abs=1e-3
    )


def test_one_who_comes_too_late_has_not_reached_it() -> None:
    outcome = goal_outcome(walk(0.2, 4.0))
    assert outcome.reached is None and outcome.stopped is None and outcome.standing() is None
    assert math.isnan(outcome.steps) and math.isnan(outcome.seconds_to_stand)
    assert outcome.final_distance == pytest.approx(4.0 - 0.2 * 12, abs=0.02)
    assert outcome.walking() == slice(0, STEP_LIMIT * NEW_FRAMES)


def test_passing_within_075_but_not_within_03() -> None:
    outcome = goal_outcome(trajectory(line(metres(1.0, 99.0)) + np.array([0.5, 0.0]), GOAL))
    assert outcome.reached is not None and outcome.near is None
    assert outcome.stopped is None


def test_standing_before_the_goal_is_no_arrival() -> None:
    outcome = goal_outcome(walk(1.0, 2.0))
    assert outcome.reached is None and outcome.stopped is None


def test_drift_is_the_farthest_place_after_the_stand() -> None:
    way, standing = line(metres(1.0, 3.9)), metres(1.0, 3.9) >= 3.9
    begin = int(np.flatnonzero(standing)[0])
    way[begin + 60, 0] = 0.2  # within two seconds, and back again
    way[begin + 100, 0] = 0.6  # within five
    way[begin + 250, 0] = 5.0  # later: not watched
    outcome = goal_outcome(trajectory(way, GOAL, standing=standing))
    assert outcome.drift_2s == pytest.approx(0.2) and outcome.drift_5s == pytest.approx(0.6)


def test_a_stand_that_cannot_be_watched_does_not_count() -> None:
    standing = np.zeros(FRAMES, bool)
    standing[-100:] = True
    assert goal_outcome(trajectory(line(metres(1.0, 3.9)), GOAL, standing=standing)).stopped is None


def test_rows_average_over_the_runs_in_which_it_happened() -> None:
    goal = Goal((0.0, 4.0, 0.0), heading=0.0)
    outcomes = [goal_outcome(walk(1.0, 3.9, goal, 0.1)), goal_outcome(walk(0.2, 4.0, goal))]
    row = goal_row("two", outcomes)
    assert row["runs"] == 2
    assert row["success"] == row["success_03m"] == row["stopped"] == 0.5
    assert row["steps"] == 17 and row["arrival_error_median_m"] == pytest.approx(0.1)
    assert row["final_distance_m"] == pytest.approx((0.1 + 1.6) / 2, abs=0.02)
    assert row["facing_error_p90_deg"] == pytest.approx(np.degrees(0.1), abs=1e-3)


def test_rows_of_failures_only_have_no_averages() -> None:
    row = goal_row("none", [goal_outcome(walk(0.2, 4.0))])
    assert row["success"] == 0.0
    for figure in ("steps", "drift_5s_max_m", "arrival_error_median_m", "facing_error_median_deg"):
        assert math.isnan(float(row[figure]))
