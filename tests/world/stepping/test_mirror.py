"""Mirrored agents: the engine's inputs are reflected, but not the motion that is sent."""

from dataclasses import fields, replace

import numpy as np
import pytest

from tests.world.fakes import FakeEngine, make_world, people
from wayfarer.body.library import load_body
from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.engines.dummy import dummy_inputs
from wayfarer.spec import BETAS, GENDERS
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.stepping.mirror import is_mirrored, mirror_inputs, mirror_outputs

BOTH = np.array([True, False])


def inputs():
    """Two random rows."""
    random = np.random.default_rng(3)
    drawn = dummy_inputs(2, 1)
    return replace(
        drawn,
        **{
            field.name: random.normal(size=getattr(drawn, field.name).shape).astype(np.float32)
            for field in fields(drawn)
        },
    )


def test_half_of_all_seeds_are_in_the_mirror_without_a_pattern():
    flags = is_mirrored(np.arange(10_000, dtype=np.uint64))
    assert 0.48 < flags.mean() < 0.52
    assert 0.2 < (flags[1:] == flags[:-1]).mean() < 0.8


def test_only_the_rows_in_the_mirror_are_reflected_and_twice_is_once_more():
    asked = inputs()
    found = mirror_inputs(asked, BOTH)
    again = mirror_inputs(found, BOTH)
    changed = set()
    for field in fields(asked):
        before, after = getattr(asked, field.name), getattr(found, field.name)
        np.testing.assert_array_equal(after[1], before[1])
        np.testing.assert_array_equal(getattr(again, field.name), before)
        if not np.array_equal(after[0], before[0]):
            changed.add(field.name)
    assert changed == {
        "seed_markers", "seed_translation", "seed_rotations", "goal", "facing", "obstacles"
    }  # fmt: skip
    np.testing.assert_array_equal(found.goal[0], asked.goal[0] * [-1, 1, 1])


@pytest.mark.parametrize("gender", GENDERS)
def test_a_reflected_pose_has_reflected_markers(gender):
    body = load_body("anny52", gender, "low")
    random = np.random.default_rng(5)
    pose = random.normal(size=(2, 1, 22, 4)) * [0.1, 0.1, 0.1, 0] + [0, 0, 0, 1]
    pose = (pose / np.linalg.norm(pose, axis=-1, keepdims=True)).astype(np.float32)
    betas = random.normal(size=BETAS)

    def markers(rotations, hips):
        turns, places = body.forward_kinematics(
            hips, matrix_from_quaternion(rotations), body.rest_joints(betas)
        )
        return body.markers(betas, turns, places)

    hips = np.array([[0.3, 0.2, 0.9]])
    asked = replace(
        inputs(),
        seed_rotations=pose,
        seed_translation=hips[None].repeat(2, 0).astype(np.float32),
        seed_markers=markers(pose[0], hips)[None].repeat(2, 0).astype(np.float32),
    )
    seen = mirror_inputs(asked, BOTH)
    made = markers(seen.seed_rotations[0].astype(float), seen.seed_translation[0].astype(float))
    np.testing.assert_allclose(seen.seed_markers[0], made, atol=1e-6)


class Lefty(FakeEngine):
    """Drifts to the left, whatever the request."""

    def step(self, gender, inputs):
        made = super().step(gender, inputs)
        moved = made.translation.copy()
        moved[..., 0] -= np.linspace(0.005, 0.04, moved.shape[1], dtype=np.float32)
        return replace(made, translation=moved)


def test_a_model_that_prefers_a_side_does_not_make_a_crowd_that_does():
    world = make_world(Lefty())
    world.create_session(SessionSpec("s"), 0.0)
    specs = [replace(s, noise_seed=i) for i, s in enumerate(people(16))]
    agents = world.create_agents("s", specs, 0.0)
    for agent, spec in zip(agents, specs, strict=True):
        world.give(agent.agent_id, Goal((spec.position[0], 50.0, 0.0)), 0.0)
    aside = {}
    for chunk in world.advance(2.0):
        aside[chunk.agent_id] = float(chunk.translation[-1, 0])
    ways = [aside[a.agent_id] - s.position[0] for a, s in zip(agents, specs, strict=True)]
    flags = is_mirrored(np.arange(16, dtype=np.uint64))
    assert 0 < flags.sum() < 16
    assert [way > 0 for way in ways] == flags.tolist()


def test_outputs_come_back_to_this_side():
    engine = FakeEngine()
    asked = dummy_inputs(2, 1)
    plain = engine.step("male", asked)
    through = mirror_outputs(engine.step("male", mirror_inputs(asked, BOTH)), BOTH)
    for field in fields(plain):
        np.testing.assert_allclose(getattr(through, field.name), getattr(plain, field.name))
