"""Long runs through the real world, with an engine that glides."""

from dataclasses import replace

import numpy as np

from tests.lab.evaluation.people import BODIES, make_world
from tests.world.fakes import FakeEngine
from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer_lab.evaluation import wander as module
from wayfarer_lab.evaluation.tasks import random_specs
from wayfarer_lab.evaluation.wander import Wandering, wander


def seen(engine: FakeEngine, agents: int, seconds: float) -> Wandering:
    random = np.random.default_rng(0)
    return wander(make_world(engine), BODIES, random_specs(agents, random), seconds, random)


def test_wandering_bodies_go_from_goal_to_goal_and_stay_well() -> None:
    made = seen(FakeEngine(), 3, 60.0)
    assert made.goals_reached > 3 * 3, "a goal takes less than 20 s"
    assert made.goals_reached <= made.goals_given
    assert all(not any(h.faults.values()) for h in made.health)
    assert all(h.frames >= 55 * 40 for h in made.health)
    assert made.resets == 0 and made.gait


def test_memory_is_bounded(monkeypatch) -> None:
    monkeypatch.setattr(module, "KEPT", 5)
    made = seen(FakeEngine(), 3, 60.0)  # 36 blocks of 5 s
    assert 3 <= len(made.gait) <= 5


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
    made = seen(RisingEngine(), 2, 20.0)
    assert all(h.faults["floating"] > 0 for h in made.health)


class CirclingEngine(FakeEngine):
    """Lets nobody come nearer to a goal than half a metre, and turns them by 30 degrees a step."""

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        way = inputs.goal[:, :2] - inputs.seed_translation[:, -1, :2]
        length = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
        goal = inputs.goal.copy()
        goal[:, :2] -= way / length * np.float32(0.5)
        made = super().step(gender, replace(inputs, goal=goal))
        angle = np.arctan2(made.rotations[..., 0, 2], made.rotations[..., 0, 3]) + np.radians(15)
        made.rotations[..., 0, 2], made.rotations[..., 0, 3] = np.sin(angle), np.cos(angle)
        return made


def test_spinning_near_a_goal_is_found_out() -> None:
    made = seen(CirclingEngine(), 2, 40.0)
    assert made.goals_reached == 0 and made.goals_given > 2, "patience ends"
    assert all(h.faults["spinning"] > 0 for h in made.health)
    assert not any(h.faults["tilted"] for h in made.health)
