"""Judging goal runs whose trajectory is known."""

import math

import numpy as np
import pytest

from tests.lab.evaluation.people import line, trajectory
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.outcome import STEP_LIMIT, goal_outcome
from wayfarer_lab.evaluation.tasks import Trajectory

GOAL = Goal((0.0, 4.0, 0.0))


def metres(speed: float, stop_at: float) -> np.ndarray:
    return np.minimum(np.arange(1, STEP_LIMIT * NEW_FRAMES + 15 * FPS + 1) / FPS * speed, stop_at)


def walk(speed: float, stop_at: float) -> Trajectory:
    """Along Y at `speed` m/s to y = `stop_at`, and standing there."""
    return trajectory(line(metres(speed, stop_at)), GOAL)


def test_a_walk_to_the_goal() -> None:
    outcome = goal_outcome(walk(1.0, 3.9))
    assert outcome.reached == pytest.approx(3.25 * FPS, abs=1)
    assert outcome.steps == 17, "3.25 s are 16.25 steps of 0.2 s: the goal is reached in the 17th"
    assert outcome.near and outcome.final_distance == pytest.approx(0.1)
    assert outcome.walking() == slice(0, outcome.reached)


def test_frames_count_from_the_order() -> None:
    way = line(np.concatenate([np.zeros(100), metres(1.0, 3.9)]))
    assert (
        goal_outcome(trajectory(way, GOAL, frame=100)).reached
        == goal_outcome(walk(1.0, 3.9)).reached
    )


def test_one_who_comes_too_late_has_not_reached_it() -> None:
    outcome = goal_outcome(walk(0.2, 4.0))
    assert outcome.reached is None and not outcome.near and math.isnan(outcome.steps)
    assert outcome.final_distance == pytest.approx(4.0 - 0.2 * 12, abs=0.02)
    assert outcome.walking() == slice(0, STEP_LIMIT * NEW_FRAMES)


def test_passing_within_075_but_not_within_03() -> None:
    outcome = goal_outcome(trajectory(line(metres(1.0, 99.0)) + np.array([0.5, 0.0]), GOAL))
    assert outcome.reached is not None and not outcome.near
