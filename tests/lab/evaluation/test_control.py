"""Table 1 with an engine that glides: trees, single bodies and their rows."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.lab.evaluation.people import BODIES, make_world
from tests.world.fakes import FakeEngine
from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.spec import NEW_FRAMES
from wayfarer.terms import WALK, weights
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.steering import Steering
from wayfarer.world.search.beam_settings import BeamSettings
from wayfarer_lab.evaluation import control as module
from wayfarer_lab.evaluation.control import (
    Pair,
    Trial,
    control_row,
    mocap_row,
    offline,
    online,
    random_pairs,
    told_the_goal_alone,
)
from wayfarer_lab.evaluation.gait import Windows

BODY = BODIES["male"]


def pairs(count: int = 3, speed: float = 1.4) -> list[Pair]:
    return random_pairs(count, speed, np.random.default_rng(0))


def tree_trials(engine: FakeEngine, some: list[Pair], **settings: object) -> list[Trial]:
    beam = replace(BeamSettings(children=1, keep=4, roots=4, reach=0.3), **settings)
    return list(offline(engine, make_world(), BODIES, some, beam, np.random.default_rng(0)))


def test_goals_lie_anywhere_in_the_area_but_not_at_the_start() -> None:
    ways = np.array([np.subtract(p.goal.position[:2], p.spec.position) for p in pairs(400)])
    assert np.abs(ways).max() <= 10.0 and np.abs(ways).max(0).min() > 9.5
    assert np.linalg.norm(ways, axis=-1).min() > 0.75
    assert {p.goal.speed for p in pairs(3, 2.0)} == {2.0}


def test_clones_glide_to_the_goal() -> None:
    some = pairs()
    for pair, trial in zip(some, tree_trials(FakeEngine(), some), strict=True):
        way = np.linalg.norm(np.subtract(pair.goal.position[:2], pair.spec.position)) - 0.75
        least = way / (1.4 * 0.2)  # steering may slow down at both ends
        assert least - 1 <= trial.steps <= 1.3 * least + 4
        assert trial.near and len(trial.distances) == 4
        assert all(len(track.hips) == trial.steps * NEW_FRAMES for track in trial.tracks)
        ends = [np.linalg.norm(t.hips[-1, :2] - pair.goal.position[:2]) for t in trial.tracks]
        assert max(ends) == pytest.approx(0.75, abs=0.3), "cut at 0.75 m, though it goes on to 0.3"
        starts = [np.linalg.norm(t.hips[0, :2] - pair.spec.position) for t in trial.tracks]
        assert max(starts) < 0.1, "a track is the whole way of one clone"


class ListeningEngine(FakeEngine):
    """Keeps the inputs of each step."""

    def __init__(self) -> None:
        super().__init__()
        self.told: list[StepInputs] = []

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        self.told.append(inputs)
        return super().step(gender, inputs)


def told(steering: Steering | None) -> list[StepInputs]:
    """The first steps of twelve bodies; behind some of them lies the goal."""
    engine, beam = ListeningEngine(), BeamSettings(children=1, keep=4, roots=4, depth=3, reach=0.3)
    random = np.random.default_rng(0)
    some = pairs(12, 1.2)
    list(offline(engine, make_world(), BODIES, some, beam, random, steering=steering))
    return engine.told


def test_the_paper_s_policies_are_told_the_goal_alone() -> None:
    for step in told(told_the_goal_alone()):
        assert np.allclose(step.target_speed, 1.2, atol=0.2)  # trimmed
        assert not step.facing.any()
        assert np.allclose(step.term_weights, weights(WALK))


class ShyEngine(FakeEngine):
    """Walks in a straight line to half a metre from the goal and no nearer; by its noise, a clone
    walks the other way."""

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        way = inputs.goal[:, :2] - inputs.seed_translation[:, -1, :2]
        length = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
        goal = inputs.goal.copy()
        goal[:, :2] -= way / length * np.float32(0.5)
        flee = np.sin(1e3 * inputs.noise[:, 0, 0]) < 0  # even if an agent's own latent is added
        goal[flee, :2] = (inputs.seed_translation[:, -1, :2] - 10 * way)[flee]
        return super().step(gender, replace(inputs, goal=goal))


def test_clones_that_have_arrived_count_as_zero_and_the_others_by_their_distance() -> None:
    some = [
        Pair(p.spec, Goal((p.spec.position[0], p.spec.position[1] + 1.1, 0.0))) for p in pairs(4)
    ]
    trials = tree_trials(ShyEngine(), some)
    assert any(0 < (t.distances == 0).sum() < 4 for t in trials), "some clones fled at first"
    for trial in trials:
        assert not trial.near and (math.isnan(trial.steps) or trial.steps >= 1)
        assert ((trial.distances == 0) | (trial.distances > 0.75)).all()


def test_the_best_of_a_level_are_kept() -> None:
    some = pairs(2)
    trials = tree_trials(FakeEngine(), some, children=4, keep=1)
    assert [len(t.distances) for t in trials] == [1, 1]
    assert [len(t.tracks) for t in trials] == [1, 1]


def test_pairs_do_not_depend_on_those_beside_them(monkeypatch: pytest.MonkeyPatch) -> None:
    some = pairs(3)
    together = tree_trials(FakeEngine(), some)
    monkeypatch.setattr(module, "TOGETHER", 1)
    alone = tree_trials(FakeEngine(), some)
    assert [t.steps for t in together] == [t.steps for t in alone]
    assert all(
        np.array_equal(a.distances, b.distances) for a, b in zip(together, alone, strict=True)
    )


class BrokenEngine(FakeEngine):
    """Makes only invalid frames."""

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        made = super().step(gender, inputs)
        return replace(made, translation=made.translation * np.nan)


def test_a_broken_engine_reaches_nothing() -> None:
    some = pairs(1)
    (trial,) = tree_trials(BrokenEngine(), some)
    assert math.isnan(trial.steps) and not trial.near and not trial.tracks
    way = np.subtract(some[0].goal.position[:2], some[0].spec.position)
    assert trial.distances == pytest.approx([np.linalg.norm(way)])


def test_single_bodies_arrive_as_served() -> None:
    some = pairs(4)
    for pair, trial in zip(some, online(make_world(), BODIES, some), strict=True):
        way = np.linalg.norm(np.subtract(pair.goal.position[:2], pair.spec.position)) - 0.75
        least = way / (1.4 * 0.2)
        assert least - 1 <= trial.steps <= 1.3 * least + 4
        assert trial.near and trial.distances.tolist() == [0.0]


def test_who_is_too_slow_has_its_distance_counted() -> None:
    some = pairs(4, speed=0.2)
    row = control_row("slow", list(online(make_world(), BODIES, some)), BODY)
    ways = [np.linalg.norm(np.subtract(p.goal.position[:2], p.spec.position)) for p in some]
    assert row["success"] == row["success_03m"] == 0.0 and math.isnan(row["steps"])
    assert row["avg_dist"] == pytest.approx(np.mean(ways) - 12 * 0.2, abs=0.1)


def test_rows_have_the_papers_figures_and_the_strict_ones_beside() -> None:
    trials = tree_trials(FakeEngine(), pairs(3, speed=1.2))
    row = control_row("glide", trials, BODY)
    assert list(row)[:6] == ["name", "pairs", "success", "success_03m", "steps", "avg_dist"]
    assert row["success"] == 1.0 and row["pairs"] == 3
    assert {"contact", "contact_strict", "slide_cm_s", "penetration_cm", "seam_ratio"} <= set(row)
    assert row["walk_windows"] > 0 and row["walk_slide_cm_s"] == pytest.approx(120, abs=5)


def test_the_row_of_recordings_has_the_same_figures_but_no_goals() -> None:
    trials = tree_trials(FakeEngine(), pairs(2, speed=1.2))
    motion = Windows.join([track.windows() for trial in trials for track in trial.tracks])
    row = mocap_row("mocap", motion, BODY)
    assert set(row) == set(control_row("glide", trials, BODY))
    assert math.isnan(row["success"]) and row["slide_cm_s"] == pytest.approx(120, abs=5)
