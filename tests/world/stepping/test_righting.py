"""Agents that lean too far straighten up, in the pose and in the next step's markers."""

from dataclasses import replace

import numpy as np
import pytest

from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import matrix_from_quaternion, quaternion_from_rotvec
from wayfarer.body.skeleton import joint_names
from wayfarer.models.bundle import START_POSES, load_bodies
from wayfarer.spec import NEW_FRAMES, SEED_FRAMES
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.slots import Mode
from wayfarer.world.agents.spawn import Spawner, load_start_poses
from wayfarer.world.output.quaternion import multiply
from wayfarer.world.stepping.righting import (
    MOST,
    MOST_ON_THE_SPOT,
    SHARE,
    TURN_MOST,
    Step,
    right_rows,
)

BODIES = load_bodies("anny52")
SPAWNER = Spawner(BODIES, load_start_poses(START_POSES))
SPINE = [joint_names().index(f"spine{k}") for k in (1, 2, 3)]


def markers_of(body: BodyModel, spec: AgentSpec, hips: np.ndarray, turns: np.ndarray) -> np.ndarray:
    betas = np.array(spec.betas)
    posed = matrix_from_quaternion(turns.astype(np.float64))
    return body.markers(
        betas, *body.forward_kinematics(hips.astype(np.float64), posed, body.rest_joints(betas))
    )


def leaning(spec: AgentSpec, degrees: tuple[float, float]) -> Step:
    """A standing person that leans ahead and to the right by these degrees more than usual."""
    seed = SPAWNER.stand(spec).seed
    turns = seed.rotations[0, -1].copy()
    more = quaternion_from_rotvec(np.radians([-degrees[0] / 3, degrees[1] / 3, 0]))
    for joint in SPINE:
        turns[joint] = multiply(turns[joint], more)
    hips = seed.translation[0, -1]
    markers = markers_of(BODIES[spec.gender], spec, hips, turns).astype(np.float32)
    return Step(
        np.tile(hips, (1, NEW_FRAMES, 1)),
        np.tile(turns, (1, NEW_FRAMES, 1, 1)),
        np.tile(markers, (1, SEED_FRAMES, 1, 1)),
    )


def lean(step: Step, frame: int = -1) -> float:
    """Angle in radians between spine and vertical, mean over its joints."""
    turns = step.rotations[0, frame].astype(np.float64)
    turn, up = turns[0], np.zeros(3)
    for joint in SPINE:
        turn = multiply(turn, turns[joint])
        up += matrix_from_quaternion(turn)[:, 2]
    return float(np.arctan2(np.hypot(up[0], up[1]), up[2]))


def righted(mode: np.ndarray, step: Step) -> Step:
    """The step after the rule."""
    found = Step(*(np.array(part, np.float32) for part in step))
    right_rows(mode, found)
    return found


def modes(mode: Mode) -> np.ndarray:
    return np.array([mode], np.int8)


SOMEBODY = AgentSpec(noise_seed=3, heading=0.7)


@pytest.mark.parametrize("degrees", [(0.0, 0.0), (9.0, 0.0), (0.0, -11.0)])
def test_a_lean_that_walkers_have_is_left_to_them(degrees):
    step = leaning(SOMEBODY, degrees)
    assert lean(step) < MOST
    for made, given in zip(righted(modes(Mode.WALKING), step), step, strict=True):
        np.testing.assert_array_equal(made, np.float32(given))


@pytest.mark.parametrize(
    ("mode", "most"),
    [
        (Mode.WALKING, MOST),
        (Mode.STOPPING, MOST),
        (Mode.STANDING, MOST_ON_THE_SPOT),
        (Mode.TURNING, MOST_ON_THE_SPOT),
        (Mode.STRAFING, MOST),
    ],
)
@pytest.mark.parametrize("degrees", [(30.0, 0.0), (-30.0, 0.0), (25.0, 25.0), (0.0, -40.0)])
def test_a_part_of_a_larger_lean_is_taken_off_by_the_end_of_the_step(mode, most, degrees):
    step = leaning(SOMEBODY, degrees)
    before, after = lean(step), righted(modes(mode), step)
    assert lean(after) == pytest.approx(before - min(SHARE * (before - most), TURN_MOST), abs=2e-3)
    leans = [before, *(lean(after, frame) for frame in range(NEW_FRAMES))]
    assert (np.diff(leans) < 0).all(), "by degrees"
    others = [joint for joint in range(22) if joint not in SPINE]
    np.testing.assert_array_equal(after.rotations[:, :, others], step.rotations[:, :, others])
    np.testing.assert_array_equal(after.translation, step.translation)


def test_the_next_step_starts_from_the_markers_of_that_body():
    rng = np.random.default_rng(0)
    for number in range(12):
        gender = ("female", "male")[number % 2]
        spec = AgentSpec(
            gender=gender,
            betas=tuple(rng.uniform(-2, 2, 10)),
            heading=rng.uniform(-3, 3),
            noise_seed=number,
        )
        size, way = rng.uniform(15, 40), rng.uniform(-3, 3)
        step = leaning(spec, (size * np.cos(way), size * np.sin(way)))
        after = righted(modes(Mode.STANDING), step)
        body = BODIES[gender]
        for frame in range(SEED_FRAMES):
            place = frame - SEED_FRAMES
            wanted = markers_of(body, spec, step.translation[0, place], after.rotations[0, place])
            off = np.linalg.norm(after.markers[0, frame] - wanted, axis=-1)
            moved = np.linalg.norm(step.markers[0, frame] - wanted, axis=-1)
            assert off.max() < max(0.006, 0.15 * moved.max())
            same = (after.markers[0, frame] == step.markers[0, frame]).all(-1)
            assert same[moved < 1e-6].all() and not same.all()


def test_rows_do_not_influence_each_other():
    steps = [leaning(replace(SOMEBODY, noise_seed=k), (6.0 * k, -4.0 * k)) for k in range(6)]
    both = Step(*(np.concatenate(parts) for parts in zip(*steps, strict=True)))
    mode = np.array([k % len(Mode) for k in range(6)], np.int8)
    together = righted(mode, both)
    for k, step in enumerate(steps):
        alone = righted(mode[k : k + 1], step)
        np.testing.assert_array_equal(together.rotations[k], alone.rotations[0])
        np.testing.assert_array_equal(together.markers[k], alone.markers[0])
