"""Impossible poses are repaired before they are sent, and nothing else changes."""

from itertools import pairwise

import numpy as np
import pytest

from tests.world.fakes import GOAL, FakeEngine, populated
from tests.world.output.legwork import legs, standing
from tests.world.stepping.guarded import bendable, fallen
from wayfarer.body.rotation import quaternion_from_rotvec
from wayfarer.body.skeleton import joint_names
from wayfarer.spec import NEW_FRAMES
from wayfarer.world.agents.agent import AgentState, ChunkFlag
from wayfarer.world.agents.slots import Motion, Seeds
from wayfarer.world.output.legs import KNEES
from wayfarer.world.stepping.guards import KNEE, SIDEWAYS, got_up

ELBOW, SHOULDER, SPINE = (
    joint_names().index(name) for name in ("left_elbow", "left_shoulder", "spine1")
)


def step(frames: int = NEW_FRAMES) -> tuple[Seeds, np.ndarray, np.ndarray]:
    """A standing person: seed, and the translation and rotations of the next step."""
    translation, rotations = standing(2 + frames)
    seed = Seeds.empty(1)
    seed.translation[:], seed.rotations[:] = translation[:, :2], rotations[:, :2]
    return seed, translation[:, 2:], rotations[:, 2:].copy()


def turn(x: float, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    """A rotation by angles in degrees."""
    return quaternion_from_rotvec(np.radians([x, y, z]))


def largest_change(seed: Seeds, rotations: np.ndarray) -> float:
    """Degrees per frame²."""
    path = np.concatenate([seed.rotations, rotations], 1)
    return float(np.degrees(2 * np.linalg.norm(np.diff(path, 2, axis=1), axis=-1).max()))


def test_what_a_body_can_do_is_left_to_the_last_bit():
    _, _, rotations = step()
    rotations[0, :, ELBOW] = [turn(0, 0, 3.0 * frame**1.5) for frame in range(NEW_FRAMES)]
    made, mended = bendable(rotations, legs())
    np.testing.assert_array_equal(made, rotations)
    assert not mended.any()


@pytest.mark.parametrize(("asked", "sent"), [(-40.0, KNEE[0]), (170.0, KNEE[1]), (200.0, KNEE[1])])
def test_knees_bend_as_far_as_knees_do(asked, sent):
    _, _, rotations = step()
    rotations[:, :, KNEES] = turn(-asked)
    made, mended = bendable(rotations, legs())
    assert mended.all()
    bend = -2 * np.arctan2(made[..., KNEES, 0], made[..., KNEES, 3]) % (2 * np.pi)
    np.testing.assert_allclose(bend, sent % (2 * np.pi), atol=1e-4)
    others = [joint for joint in range(22) if joint not in KNEES]
    np.testing.assert_array_equal(made[:, :, others], rotations[:, :, others])


def test_a_knee_bends_and_does_little_else():
    _, _, rotations = step()
    rotations[:, :, KNEES] = turn(-30, 50, 40)
    made = bendable(rotations, legs())[0][0, -1, KNEES[0]]
    assert 2 * np.arcsin(np.hypot(*made[1:3])) == pytest.approx(SIDEWAYS, abs=1e-3)
    assert made[0] / made[3] == pytest.approx(turn(-30, 50, 40)[0] / turn(-30, 50, 40)[3], abs=1e-3)
    assert np.linalg.norm(made) == pytest.approx(1, abs=1e-5)


def test_who_leans_or_squats_has_fallen():
    shape = legs(3)
    _, translation, rotations = step()
    translation, rotations = (np.repeat(values, 3, axis=0) for values in (translation, rotations))
    rotations[1, :, SPINE] = turn(-50)
    translation[2, :, 2] *= 0.7
    np.testing.assert_array_equal(fallen(translation, rotations, shape), [False, True, True])


def test_getting_up_takes_a_step_and_jumps_nowhere():
    seed, translation, _ = step()
    seed.translation[..., 2] -= 0.4
    seed.rotations[:, :, SPINE] = turn(-60)
    stand = Motion.empty(1)
    stand.seed.translation[:], stand.seed.rotations[:] = translation[:, :2], standing(2)[1]
    hips, rotations = got_up(seed, stand)
    np.testing.assert_allclose(hips[0, -1], translation[0, -1], atol=1e-6)
    np.testing.assert_allclose(rotations[0, -1], stand.seed.rotations[0, -1], atol=1e-6)
    path = np.concatenate([seed.translation[:, 1:], hips], 1)[0, :, 2]
    assert np.abs(np.diff(path, 2)).max() < 0.04
    assert largest_change(seed, rotations) < 8


def test_arms_that_are_far_from_a_stand_get_there_later():
    seed, translation, _ = step()
    stand = Motion.empty(1)
    stand.seed.translation[:], stand.seed.rotations[:] = translation[:, :2], standing(2)[1]
    seed.rotations[:, :, SHOULDER] = turn(0, 170, 0)
    _, rotations = got_up(seed, stand)
    assert largest_change(seed, rotations) < 5
    left = 2 * np.arccos(np.abs(rotations[0, -1, SHOULDER, 3]))
    assert np.degrees(left) == pytest.approx(170 - 60, abs=0.5)
    shown = stand.seed.rotations[0, :, SHOULDER]
    np.testing.assert_array_equal(shown, rotations[0, [-1, -1], SHOULDER], "it goes on from there")


class Faller(FakeEngine):
    """The body bows while `bows` is set."""

    bows = False

    def step(self, gender, inputs):
        outputs = super().step(gender, inputs)
        if self.bows:
            outputs.rotations[:, :, SPINE] = turn(-70).astype(np.float32)
        return outputs


def test_somebody_who_falls_stands_within_a_second_is_counted_and_walks_on():
    engine = Faller()
    world, [agent] = populated(1, engine)
    world.give(agent, GOAL, 0.0)
    before = list(world.advance(1.0))
    engine.bows = True
    chunks = before + list(world.advance(1.3))
    engine.bows = False
    chunks += world.advance(12.0)
    assert world.scheduler.resets >= 1
    assert not any(chunk.flags & ChunkFlag.FIRST for chunk in chunks), "no pose jumps"
    bent = [bool(np.abs(chunk.rotations[-1, SPINE, 0]) > 0.3) for chunk in chunks]
    assert not any(bent), "who falls is back on his feet by the end of that step"
    places = np.concatenate([chunk.translation for chunk in chunks])
    assert np.linalg.norm(np.diff(places, axis=0), axis=-1).max() < 0.1
    assert chunks[-1].state is AgentState.STANDING
    assert np.linalg.norm(places[-1, :2] - GOAL.position[:2]) < 0.3
    assert all(b.seq == a.seq + 1 for a, b in pairwise(chunks))


class Bender(FakeEngine):
    """The left knee bends the wrong way."""

    def step(self, gender, inputs):
        outputs = super().step(gender, inputs)
        outputs.rotations[:, :, KNEES[0]] = turn(60).astype(np.float32)
        return outputs


def test_steps_that_are_mended_are_counted():
    for engine, some in ((FakeEngine(), False), (Bender(), True)):
        world, [agent] = populated(1, engine)
        world.give(agent, GOAL, 0.0)
        assert list(world.advance(2.0))
        assert (world.scheduler.mended_steps > 0) is some
        assert world.scheduler.resets == 0
