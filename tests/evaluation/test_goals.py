"""Goal runs and long runs through the real world with an engine that glides."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.fakes import BODIES, FakeEngine, make_world
from wayfarer.evaluation.goals import random_specs, run_goals
from wayfarer.evaluation.outcome import goal_row
from wayfarer.evaluation.wander import wander
from wayfarer.runtime.engine import StepInputs, StepOutputs
from wayfarer.spec import GENDERS


def runs(seed: int = 0, walking: bool = False):
    random = np.random.default_rng(seed)
    return run_goals(make_world(phases=1), BODIES, random_specs(4, random), random, walking=walking)


@pytest.mark.parametrize("walking", [False, True])
def test_gliding_bodies_arrive_and_stand(walking: bool) -> None:
    made = runs(walking=walking)
    row = goal_row("glide", [run.outcome for run in made])
    assert row["success_075m"] == 1.0 and row["stopped"] == 1.0
    assert 0 <= row["arrival_error_m"] <= 0.75
    assert row["drift_5s_max_m"] < 0.5
    # 3 … 8 m less 0.75 m at 1.2 m/s and 0.2 s a step
    assert 2.25 / 0.24 - 1 <= row["steps"] <= 7.25 / 0.24 + 5


def test_a_track_ends_with_the_stand_and_starts_with_the_goal() -> None:
    for run in runs():
        stand = run.outcome.standing()
        assert stand is not None and len(run.track.hips) == stand.stop
        assert np.isfinite(run.track.markers).all()
        assert abs(run.track.markers[..., 2].min()) < 0.01, "spawned on the floor"


def test_the_seed_decides_everything() -> None:
    first, again, other = runs(3), runs(3), runs(4)
    assert [r.outcome for r in first] == [r.outcome for r in again]
    assert [r.spec for r in first] != [r.spec for r in other]


def test_specs_are_of_both_genders_and_many_shapes() -> None:
    specs = random_specs(10, np.random.default_rng(0))
    assert [s.gender for s in specs] == list(GENDERS) * 5
    assert len({s.betas for s in specs}) == len({s.position for s in specs}) == 10
    assert max(abs(b) for s in specs for b in s.betas) <= 2.0


def test_wandering_bodies_go_from_goal_to_goal_and_stay_well() -> None:
    random = np.random.default_rng(0)
    seen = wander(make_world(phases=1), BODIES, random_specs(3, random), 60.0, random)
    assert seen.goals_reached > 3 * 3, "a goal takes less than 20 s"
    assert seen.goals_reached <= seen.goals_given
    assert all(not any(h.faults.values()) for h in seen.health)
    assert all(h.frames >= 55 * 40 for h in seen.health)
    assert seen.resets == 0 and seen.gait


class RisingEngine(FakeEngine):
    """Lifts a body by 2 mm in every step."""

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        made = super().step(gender, inputs)
        lift = np.float32([0.0, 0.0, 0.002])
        return replace(
            made,
            translation=made.translation + lift,
            next_seed_markers=made.next_seed_markers + lift,
        )


def test_a_rising_engine_is_found_out() -> None:
    random = np.random.default_rng(0)
    world = make_world(RisingEngine(), phases=1)
    seen = wander(world, BODIES, random_specs(2, random), 20.0, random)
    assert all(h.faults["floating"] > 0 for h in seen.health)
