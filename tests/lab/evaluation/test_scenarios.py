"""The scenarios of `eval arrival`, through the real world, with an engine that glides and turns."""

import math

import numpy as np
import pytest

from tests.lab.evaluation.people import make_world
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.outcome import goal_outcome, goal_row
from wayfarer_lab.evaluation.scenarios import Scenario
from wayfarer_lab.evaluation.tasks import run_tasks


def row(scenario: Scenario, agents: int = 4) -> Row:
    tasks = scenario.tasks(agents, np.random.default_rng(0))
    trajectories = run_tasks(make_world(), tasks, scenario.seconds)
    return goal_row(scenario.name, [goal_outcome(trajectory) for trajectory in trajectories])


def test_arrivals() -> None:
    made = row(Scenario("glide", walking=True))
    assert made["success"] == made["stopped"] == 1.0
    assert 0 <= made["arrival_error_median_m"] <= 0.75
    assert made["drift_5s_max_m"] < 0.5
    # 3 … 8 m less 0.75 m at 1.2 m/s and 0.2 s a step
    assert 2.25 / 0.24 - 1 <= made["steps"] <= 7.25 / 0.24 + 5
    assert math.isnan(made["facing_error_median_deg"])


def test_arrivals_with_a_heading_are_faced() -> None:
    made = row(Scenario("facing", facing=True))
    assert made["stopped"] == 1.0
    assert made["facing_error_p90_deg"] == pytest.approx(0, abs=15)
