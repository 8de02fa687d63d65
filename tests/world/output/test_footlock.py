import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.world.output.legwork import body, legs, lifted, moved, soles_of, standing
from wayfarer.body.rotation import matrix_from_quaternion, quaternion_from_rotvec
from wayfarer.spec import BETAS, FPS
from wayfarer.world.output.footlock import LEASH, Planted, leg_shares, lock_feet
from wayfarer.world.output.legs import ANKLES, HIPS, KNEES, pose_legs
from wayfarer.world.output.quaternion import multiply
from wayfarer.world.output.twobone import MOVED

OTHERS = [joint for joint in range(22) if joint not in MOVED]


NAMES = ("ARIEL", "LTHI", "LKNE", "LSHN", "LANK", "LSOLE_TOE", "RANK", "RKNE")


def locked(translation: np.ndarray, rotations: np.ndarray) -> Planted:
    """A whole motion from its first frame, at rest there."""
    first = translation[:, [0, 0]], rotations[:, [0, 0]]
    agents = len(translation)
    nothing = np.zeros((agents, 0, 0, 3), np.float32), np.zeros((*rotations.shape[:2], 2), np.bool_)
    step = Planted(rotations, *nothing)
    return lock_feet(everybody(agents), legs(agents), leg_shares([]), first, translation, step)


def everybody(agents: int) -> np.ndarray:
    return np.ones(agents, np.bool_)


def sent_soles(translation: np.ndarray, made: Planted) -> np.ndarray:
    return soles_of(translation, made.rotations)


def walk(frames: int = 64) -> tuple[np.ndarray, np.ndarray]:
    """Steps in turn while the body glides forwards at 8 cm/s: feet slide whenever they stand."""
    translation, rotations = standing(frames)
    phase = np.arange(frames) / 32
    for foot in (0, 1):
        up = 0.5 * np.clip(np.sin(2 * np.pi * (phase + foot / 2)), 0, None) ** 2
        rotations = lifted(rotations, foot, up) if foot == 0 else _both(rotations, up)
    return moved(translation, (0.02, 0.08, 0)), rotations


def _both(rotations: np.ndarray, right: np.ndarray) -> np.ndarray:
    drawn = lifted(rotations, 1, right)
    drawn[:, :, MOVED[::2]] = rotations[:, :, MOVED[::2]]
    return drawn


def test_bearing_feet_stand_still_while_the_body_glides():
    translation, rotations = standing(20)
    translation = moved(translation, (0.03, 0.05, 0))
    made = sent_soles(translation, locked(translation, rotations))
    raw = soles_of(translation, rotations)
    assert np.abs(raw[:, -1] - raw[:, 0]).max() > 0.02
    np.testing.assert_allclose(made, made[:, :1].repeat(20, 1), atol=3e-4)


def test_only_legs_are_touched_and_quaternions_stay_unit():
    translation, rotations = walk()
    made = locked(translation, rotations).rotations
    np.testing.assert_array_equal(made[:, :, OTHERS], rotations[:, :, OTHERS])
    assert np.abs(made - rotations).max() > 0.01
    np.testing.assert_allclose(np.linalg.norm(made, axis=-1), 1, atol=1e-5)
    assert made.dtype == np.float32


def test_bones_keep_their_lengths_and_feet_their_turn():
    translation, rotations = walk()
    shape = body().rest_joints(np.zeros(BETAS))
    poses = [
        body().forward_kinematics(translation[0], matrix_from_quaternion(found[0]), shape)
        for found in (rotations, locked(translation, rotations).rotations)
    ]
    (turns, _), (new_turns, places) = poses
    np.testing.assert_allclose(new_turns[:, [7, 8, 10, 11]], turns[:, [7, 8, 10, 11]], atol=1e-5)
    parents = body().parents[1:]
    bones = np.linalg.norm(places[:, 1:] - places[:, parents], axis=-1)
    rest = np.linalg.norm(shape[1:] - shape[parents], axis=-1)
    np.testing.assert_allclose(bones, np.broadcast_to(rest, bones.shape), atol=1e-5)


@settings(max_examples=10, deadline=None)
@given(st.permutations(range(4)))
def test_an_agent_does_not_depend_on_the_others(order):
    translation, rotations = walk()
    still, pose = standing(64)
    all_ = [
        (translation, rotations),
        (still, pose),
        (moved(still, (0.5, 0, 0)), pose),
        (moved(still, (0.05, 0.02, 0.01)), rotations),
    ]
    batch = [np.concatenate(parts) for parts in zip(*(all_[i] for i in order), strict=True)]
    together = locked(*batch)
    for row, agent in enumerate(order):
        alone = locked(*all_[agent])
        np.testing.assert_allclose(together.rotations[row], alone.rotations[0], atol=1e-6)
        np.testing.assert_array_equal(together.contacts[row], alone.contacts[0])


@settings(max_examples=10, deadline=None)
@given(st.floats(-3.1, 3.1), st.floats(-50, 50), st.floats(-50, 50))
def test_it_is_the_same_anywhere_and_any_way_round(angle, x, y):
    translation, rotations = walk()
    turn = quaternion_from_rotvec(np.array([0, 0, angle]))
    place = translation @ matrix_from_quaternion(turn).T + np.array([x, y, 0])
    turned = rotations.copy()
    turned[0, :, 0] = [multiply(turn, root) for root in rotations[0, :, 0]]
    here = locked(translation, rotations).rotations
    there = locked(place.astype(np.float32), turned).rotations
    np.testing.assert_allclose(there[:, :, 1:], here[:, :, 1:], atol=2e-3)  # float32 at 50 m


def heading_of_feet(soles: np.ndarray) -> np.ndarray:
    """Radians [F, 2] of the line from heel to balls, of soles [1, F, 2, P, 3]."""
    along = soles[0, :, :, 1:3, :2].mean(2) - soles[0, :, :, 0, :2]
    return np.unwrap(np.arctan2(along[..., 1], along[..., 0]), axis=0)


def turning(rotations: np.ndarray, speed: float) -> np.ndarray:
    """The whole body, turning on the spot, radians per second."""
    turned = rotations.copy()
    for frame in range(rotations.shape[1]):
        angle = np.array([0, 0, speed * frame / FPS])
        turned[0, frame, 0] = multiply(quaternion_from_rotvec(angle), rotations[0, frame, 0])
    return turned


@pytest.mark.parametrize("heel", ["down", "up"])
def test_a_flat_foot_does_not_turn_on_the_floor_and_one_on_its_ball_does(heel):
    translation, rotations = standing(16)
    if heel == "up":
        tip = quaternion_from_rotvec(np.array([-0.3, 0, 0]))
        for ankle, ball in ((7, 10), (8, 11)):
            rotations[0, :, ankle] = multiply(rotations[0, 0, ankle], tip)
            rotations[0, :, ball] = quaternion_from_rotvec(np.array([0.3, 0, 0]))
        translation[..., 2] -= soles_of(translation, rotations)[..., 2].min()
    turned = turning(rotations, 1.0)
    made = locked(translation, turned)
    swept = np.ptp(heading_of_feet(soles_of(translation, made.rotations)), axis=0)
    assert made.contacts.all()
    assert (swept < 0.02).all() if heel == "down" else (swept > 0.3).all()


def test_markers_go_along_with_their_leg():
    translation, rotations = standing(8)
    translation = moved(translation, (0.0, 0.1, 0))
    markers = np.zeros((1, 2, len(NAMES), 3), np.float32)
    step = Planted(rotations, markers, np.zeros((1, 8, 2), np.bool_))
    first = translation[:, [0, 0]], rotations[:, [0, 0]]
    shares = leg_shares(NAMES)
    made = lock_feet(everybody(1), legs(), shares, first, translation, step)
    before, after = (pose_legs(legs(), translation, r) for r in (rotations, made.rotations))
    knees, ankles = ((after.knee - before.knee)[:, -2:], (after.ankle - before.ankle)[:, -2:])
    way = dict(zip(NAMES, np.moveaxis(made.markers, 2, 0), strict=True))
    assert np.abs(ankles[..., 1]).min() > 0.01
    np.testing.assert_allclose(way["ARIEL"], 0)
    np.testing.assert_allclose(way["LANK"], ankles[:, :, 0], atol=1e-6)
    np.testing.assert_allclose(way["LSOLE_TOE"], ankles[:, :, 0], atol=1e-6)
    np.testing.assert_allclose(way["RANK"], ankles[:, :, 1], atol=1e-6)
    np.testing.assert_allclose(way["RKNE"], knees[:, :, 1], atol=1e-6)
    np.testing.assert_allclose(way["LTHI"], knees[:, :, 0] / 2, atol=1e-6)
    np.testing.assert_allclose(way["LSHN"], (knees + ankles)[:, :, 0] / 2, atol=1e-6)


def test_markers_of_a_foot_turn_with_it():
    translation, rotations = standing(8)
    turned = turning(rotations, 1.0)
    soles = soles_of(translation, turned)
    markers = soles[:, -2:, 0, [0, 3]]  # heel and toe of the left foot
    step = Planted(turned, markers, np.zeros((1, 8, 2), np.bool_))
    first = translation[:, [0, 0]], turned[:, [0, 0]]
    shares = leg_shares(["LSOLE_HEEL", "LSOLE_TOE"])
    made = lock_feet(everybody(1), legs(), shares, first, translation, step)
    there = soles_of(translation, made.rotations)[:, -2:, 0, [0, 3]]
    assert np.abs(there - markers).max() > 0.01
    np.testing.assert_allclose(made.markers, there, atol=1e-4)


def test_who_does_not_want_it_is_left_as_given():
    translation, rotations = walk()
    both, turns = translation.repeat(2, 0), rotations.repeat(2, 0)
    step = Planted(turns, np.ones((2, 2, 1, 3), np.float32), np.ones((2, 64, 2), np.bool_))
    wanted, first = np.array([False, True]), (both[:, [0, 0]], turns[:, [0, 0]])
    made = lock_feet(wanted, legs(2), leg_shares(["LANK"]), first, both, step)
    for before, after in zip(step, made, strict=True):
        np.testing.assert_array_equal(after[0], before[0])
        assert (after[1] != before[1]).any()


def test_a_swinging_foot_is_let_go_and_comes_back_to_the_model():
    translation, rotations = walk()
    made = locked(translation, rotations)
    raw, new = soles_of(translation, rotations), soles_of(translation, made.rotations)
    off = np.linalg.norm((new - raw)[0, :, 0], axis=-1).max(-1)  # [F] left foot
    held = made.contacts[0, :, 0]
    top = int(raw[0, :, 0, :, 2].min(-1).argmax())
    assert held[0] and not held[top] and held[24:28].all()
    assert not held[raw[0, :, 0, :, 2].min(-1) > 0.05].any()
    assert off[32] > 0.03, "half a second on the floor, where the model slides 8 cm/s"
    assert off[32:].min() < 0.25 * off[32], "by the end of the step that follows"


def test_nothing_jumps():
    """At contact and at release a correction moves about as gently as a swinging foot."""
    translation, rotations = walk()
    raw, new = (
        soles_of(translation, rotations),
        sent_soles(translation, locked(translation, rotations)),
    )
    correction = (new - raw)[0].mean(2)  # [F, 2, 3]
    acceleration = np.linalg.norm(np.diff(correction, 2, axis=0), axis=-1) * FPS**2
    assert acceleration.max() < 20.0
    assert np.abs(np.diff(correction, axis=0)).max() < 0.02


def test_a_fast_foot_on_the_floor_is_not_held():
    translation, rotations = standing(16)
    made = locked(moved(translation, (1.0, 0, 0)), rotations)
    assert not made.contacts[0, 6:].any()
    np.testing.assert_allclose(made.rotations[0, 8:], rotations[0, 8:], atol=0.05)


def test_a_foot_pulled_on_for_long_slides_on_a_leash():
    """It neither stays behind without end nor snaps back."""
    translation, rotations = standing(200)
    translation = moved(translation, (0, 0.1, 0))
    made = sent_soles(translation, locked(translation, rotations))
    raw = soles_of(translation, rotations)
    behind = np.linalg.norm((raw - made)[0, ..., :2], axis=-1)
    assert LEASH[0] < behind[-1].max() < LEASH[1]
    speed = np.linalg.norm(np.diff(made[0], axis=0)[..., :2], axis=-1) * FPS
    assert speed[-40:].max() == pytest.approx(0.1, abs=0.01), "as fast as the body, no faster"
    assert speed.max() < 0.11


@pytest.mark.parametrize("height", [-0.02, 0.003])
def test_bearing_soles_settle_on_the_floor(height):
    translation, rotations = standing(24)
    translation[..., 2] += height
    made = sent_soles(translation, locked(translation, rotations))
    lowest = made[0, ..., 2].min(-1)
    assert np.abs(lowest[0]).max() < abs(height)
    assert np.abs(lowest[-1]).max() < 0.001
    assert (np.abs(np.diff(lowest, axis=0)) < abs(height)).all()


def test_a_body_high_above_the_floor_is_left_alone():
    translation, rotations = standing(8)
    translation[..., 2] += 0.2
    made = locked(translation, rotations)
    assert not made.contacts.any()
    np.testing.assert_allclose(made.rotations, rotations, atol=1e-6)


def test_trembling_feet_of_a_standing_body_come_to_rest():
    translation, rotations = standing(80)
    tremble = np.random.default_rng(0).normal(scale=0.0005, size=translation.shape)
    shaken = (translation + tremble).astype(np.float32)
    made = locked(shaken, rotations)
    assert made.contacts.all()
    speed = np.diff(soles_of(shaken, made.rotations)[0], axis=0) * FPS
    raw = np.diff(soles_of(shaken, rotations)[0], axis=0) * FPS
    assert np.abs(raw[..., :2]).mean() > 0.01
    assert np.abs(speed[..., :2]).mean() < 0.001
    assert np.abs(speed[..., 2]).mean() < np.abs(raw[..., 2]).mean()


def test_a_foot_rolls_over_its_ball():
    """While the heel rises about the ball, the ball stays although the ankle moves."""
    translation, rotations = standing(12)
    rise = np.linspace(0, 0.5, 12)
    turns = np.zeros((12, 3))
    turns[:, 0] = 0.3 - rise
    rotations[0, :, 7] = quaternion_from_rotvec(turns)  # the left foot tips forwards
    rotations[0, :, 10] = quaternion_from_rotvec(np.stack([rise, 0 * rise, 0 * rise], -1))
    translation = moved(translation, (0, 0.06, 0))
    made = sent_soles(translation, locked(translation, rotations))[0, :, 0]
    heel, balls = made[:, 0], made[:, 1:3].mean(1)
    assert heel[-1, 2] - heel[0, 2] > 0.03
    assert np.abs(balls[3:, :2] - balls[3, :2]).max() < 0.006
    raw = soles_of(translation, rotations)[0, :, 0, 1:3].mean(1)
    assert np.abs(raw[3:, :2] - raw[3, :2]).max() > 0.012


@pytest.mark.parametrize("bend", [0.0, 1e-5, 2.6])
def test_straight_and_folded_legs_give_no_nan(bend):
    translation, rotations = standing(40, bend)
    made = locked(moved(translation, (0.05, 0.1, 0.1)), rotations).rotations
    np.testing.assert_allclose(np.linalg.norm(made, axis=-1), 1, atol=1e-4)


def knees(rotations: np.ndarray) -> np.ndarray:
    """Degrees [F, 2] that the first agent's knees are bent."""
    return np.degrees(2 * np.arcsin(np.abs(rotations[0][:, KNEES, 0])))


def strides(seconds: int) -> tuple[np.ndarray, np.ndarray]:
    """Stiff strides, one a second: the foot that goes back under the body stands."""
    translation, rotations = standing(seconds * FPS)
    swing = 0.3 * np.sin(2 * np.pi * np.arange(seconds * FPS) / FPS)
    for foot, way in ((0, 1), (1, -1)):
        for joints, sign in ((HIPS, 1), (ANKLES, -1)):  # soles stay level
            turns = way * sign * swing[:, None] * np.eye(3)[0]
            rotations[0, :, joints[foot]] = multiply(
                rotations[0, :, joints[foot]].T, quaternion_from_rotvec(turns).T.astype(np.float32)
            ).T
    ankles = pose_legs(legs(), translation, rotations).ankle[0].T
    translation[0, 1:, 1] = np.abs(np.diff(ankles[1, 0])).cumsum()
    translation[0, :, 2] = -soles_of(translation * [1, 1, 0], rotations)[0, ..., 2].min((-1, -2))
    return translation.astype(np.float32), rotations
