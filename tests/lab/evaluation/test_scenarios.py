"""Every scenario, through the real world, with an engine that glides and turns."""

import math

import numpy as np
import pytest

from tests.lab.evaluation.people import make_world
from wayfarer.world.agents.agent import AgentInfo, AgentSpec, AgentState
from wayfarer_lab.evaluation.goals import run_errands
from wayfarer_lab.evaluation.scenarios import Scenario, arrival, maneuver_tables

EVERY = [
    pytest.param(title, scenario, id=f"{title}: {scenario.name}")
    for title, group in maneuver_tables().items()
    for scenario in group
]


def row(scenario: Scenario, agents: int = 2) -> dict[str, float | int | str]:
    errands = scenario.errands(agents, np.random.default_rng(0))
    return scenario.row(scenario.name, run_errands(make_world(), errands, scenario.seconds))


@pytest.mark.parametrize(("title", "scenario"), EVERY)
def test_gliding_bodies_do_what_they_are_asked(title: str, scenario: Scenario) -> None:
    made = row(scenario)
    assert made["name"] == scenario.name and made["agents"] == 2
    made.pop("steps_headed_median", None)  # gliders turn for a heading, not for a goal
    assert not any(math.isnan(v) for v in made.values() if isinstance(v, float))
    if "speed_error_mps" in made:
        assert made["speed_error_mps"] < 0.05
    for success in ("success_03m", "faced_15", "passed"):
        assert made.get(success, 1.0) == 1.0
    if "drift_max_m" in made:
        assert (
            made["drift_max_m"] < 0.7
        )  # who only goes where it is asked walks on the circle of a turn
    if "facing_error_mean_deg" in made:
        assert made["facing_error_mean_deg"] < 10.0


@pytest.mark.parametrize("walking", [False, True])
def test_arrivals(walking: bool) -> None:
    made = row(arrival("glide", walking=walking), agents=4)
    assert made["success"] == made["stopped"] == 1.0
    assert 0 <= made["arrival_error_median_m"] <= 0.75
    assert made["drift_5s_max_m"] < 0.5
    # 3 … 8 m less 0.75 m at 1.2 m/s and 0.2 s a step
    assert 2.25 / 0.24 - 1 <= made["steps"] <= 7.25 / 0.24 + 5
    assert math.isnan(made["facing_error_median_deg"])


def test_arrivals_with_a_heading_are_faced() -> None:
    made = row(arrival("facing", facing=True), agents=4)
    assert made["stopped"] == 1.0 and made["facing_error_p90_deg"] < 15.0


def test_places_are_relative_to_the_agent() -> None:
    info = AgentInfo(
        agent_id="a", alias=0, session_id="s", spec=AgentSpec(), state=AgentState.STANDING,
        position=(1.0, 2.0, 0.9), heading=np.pi / 2, goal=None, goal_revision=0, created_at=0.0,
    )  # fmt: skip
    near = maneuver_tables()["Near goals (1.5 m, from standing)"]
    expected = {"ahead": (-0.5, 2.0), "left": (1.0, 0.5), "right": (1.0, 3.5), "behind": (2.5, 2.0)}
    for scenario in near:
        (goal,) = scenario.errands(1, np.random.default_rng(0))[0].orders[0].plan(info)
        assert goal.position[:2] == pytest.approx(expected[scenario.name]), "it looks along -X"
