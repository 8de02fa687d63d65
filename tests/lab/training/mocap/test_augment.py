import numpy as np
import pytest

from tests.lab.training.mocap.synthetic import stepping
from wayfarer.body.library import load_body
from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.curve import curve
from wayfarer_lab.training.mocap.posed import LEGS, PosedMotion, at_times, stances
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.shape import RetargetShape
from wayfarer_lab.training.mocap.standing import StandingPose, stand
from wayfarer_lab.training.mocap.startstop import mid_stances, start, stop
from wayfarer_lab.training.mocap.stepturn import step_turn

SHAPE = RetargetShape("male", np.zeros(10), "own")


def walk(frames: int = 160) -> PosedMotion:
    clip = stepping(frames)
    use = np.full(frames, Use.LOCOMOTION, np.uint8)
    return PosedMotion(clip.info, SHAPE, clip.places, clip.rotations, clip.contacts, use)


def stance_slide(motion: PosedMotion) -> float:
    """Largest distance that a ball joint moves over the floor during a stance."""
    longest = 0.0
    for foot, (_, _, ball) in enumerate(LEGS):
        for a, b in stances(motion.touch[:, foot]):
            longest = max(longest, float(np.ptp(motion.places[a:b, ball, :2], axis=0).max()))
    return longest


@pytest.fixture(scope="module")
def body():
    return load_body("anny52", "male")


@pytest.fixture(scope="module")
def pose() -> StandingPose:
    return StandingPose(np.broadcast_to(np.eye(3), (22, 3, 3)).copy(), "made", "nobody")


@pytest.mark.parametrize("rate", [-0.9, 0.5])
def test_a_curved_walk_turns_and_its_feet_stay_put(rate: float) -> None:
    straight = walk()
    assert stance_slide(straight) < 1e-9
    bent = curve(straight, rate)
    turned = bent.heading()[-1] - bent.heading()[0]
    assert turned == pytest.approx(rate * len(straight) / FPS, rel=0.2)
    assert stance_slide(bent) < 1e-9
    speed = np.linalg.norm(np.diff(bent.places[:, 0], axis=0), axis=-1) * FPS
    np.testing.assert_allclose(speed, 1.0, atol=1e-6)
    assert bent.info.augmentation == "curve"
    reach = np.linalg.norm(bent.places[:, LEGS[0][1]] - bent.places[:, 1], axis=-1)
    assert reach.max() < 1.1  # feet stay near the body


def test_warping_time_keeps_feet_on_the_floor() -> None:
    fast = at_times(walk(), np.arange(0, 159, 1.25))
    assert len(fast) == 128
    assert stance_slide(fast) < 0.05  # the nearest frame's contact may be off by a frame


def test_mid_stances_have_the_other_foot_passing() -> None:
    found = mid_stances(walk())
    assert len(found) >= 5
    motion = walk()
    for frame, foot in found:
        assert motion.touch[frame, foot].all()
        assert not motion.touch[frame, 1 - foot].any()


@pytest.mark.parametrize("make", [start, stop])
def test_starts_and_stops_join_without_jumps(make, body, pose) -> None:
    motion = walk()
    frame, foot = next((k, f) for k, f in mid_stances(motion) if 50 < k < 110)
    made = make(motion, frame, foot, pose, body, np.random.default_rng(0))
    assert made.info.augmentation == make.__name__
    quiet, moving = (slice(0, 20), slice(-20, None))
    if make is stop:
        quiet, moving = moving, quiet
    speed = np.linalg.norm(np.diff(made.places[:, 0, :2], axis=0), axis=-1) * FPS
    assert speed[quiet].max() < 0.1
    assert speed[moving].min() > 0.8
    assert speed.max() < 2.0
    assert (made.use[quiet] == Use.STANDING).all()
    assert made.touch[quiet].all()
    # the free foot leaves and meets the floor without a jump
    for _, ankle, _ in LEGS:
        step = np.linalg.norm(np.diff(made.places[:, ankle], axis=0), axis=-1) * FPS
        assert step.max() < 6.0


def test_standing_keeps_both_feet_and_sways(body, pose) -> None:
    made = stand(pose, SHAPE, body, 3.0, np.random.default_rng(0))
    assert len(made) == 3 * FPS
    assert stance_slide(made) < 1e-9
    assert 0.002 < np.ptp(made.places[:, 0, 0]) < 0.08
    balls = made.places[:, [LEGS[0][2], LEGS[1][2]], 2]
    rest = body.rest_joints(np.zeros(10))
    np.testing.assert_allclose(balls, rest[LEGS[0][2], 2], atol=0.01)


@pytest.mark.parametrize("degrees", [90, -135])
def test_step_turns_end_facing_the_new_way(degrees: float, body, pose) -> None:
    made = step_turn(pose, SHAPE, body, np.deg2rad(degrees), np.random.default_rng(0))
    turned = np.rad2deg(made.heading()[-1] - made.heading()[0])
    assert turned == pytest.approx(degrees, abs=3)
    assert made.touch.any((1, 2)).all()  # never both feet in the air
    assert stance_slide(made) < 0.01
