"""Trunk, head and arms of what is sent."""

import numpy as np
import pytest

from tests.world.output.legwork import body, standing
from wayfarer.body.rotation import matrix_from_quaternion, quaternion_from_rotvec
from wayfarer.body.skeleton import joint_names
from wayfarer.spec import FPS
from wayfarer.world.output.posture import (
    DRAWN,
    ELBOW_JOINTS,
    HEAD,
    NECK,
    SHOULDERS,
    SPINE,
    TRUNK_MOST,
    TRUNK_SHARE,
    WRISTS,
    Habits,
    PostureState,
    calmed,
    habits,
    hold,
    settled,
)
from wayfarer.world.output.quaternion import multiply

NAMES = joint_names()
TOUCHED = [SPINE, NECK, HEAD, *SHOULDERS, *ELBOW_JOINTS, *WRISTS]
LEVEL = -8.0
PLAIN = Habits(
    swing=np.ones(1),
    aside=np.zeros((2, 1)),
    elbows=np.zeros((2, 1)),
    turned=np.zeros(1),
    hands=np.zeros((2, 1)),
    lean=np.zeros(1),
    level=np.radians([LEVEL]),
)
"""Arms as the model has them; upright, with a level head."""


def begun(rotations: np.ndarray, rests: bool = False) -> PostureState:
    """Of who has been in the first pose for long."""
    rest = np.full(len(rotations), rests)
    return settled(rotations[:, 0], rest, rest)


def held(rotations: np.ndarray, own: Habits, rest: float = 0.0) -> np.ndarray:
    """Of who has been in the first pose for long, and is so far at rest."""
    shares = np.full((rotations.shape[1], len(rotations)), rest, np.float32)
    return hold(begun(rotations), rotations, own, shares)[0]


def hanging(frames: int = 1) -> np.ndarray:
    """Somebody who stands with arms that hang."""
    _, rotations = standing(frames)
    for joint, side in zip(SHOULDERS, (1, -1), strict=True):
        rotations[:, :, joint] = quaternion_from_rotvec(np.array([0, -side * 1.35, 0]))
    return rotations


def pitched(rotations: np.ndarray, joint: int, degrees: float) -> np.ndarray:
    turned = rotations.copy()
    turned[:, :, joint] = quaternion_from_rotvec(np.radians([-degrees, 0, 0]))
    return turned


def pose(rotations: np.ndarray) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """World rotations and places by joint, of the first frame."""
    local = matrix_from_quaternion(rotations[0, 0].astype(np.float64))
    turns, places = body().forward_kinematics(np.zeros(3), local, body().rest_joints(np.zeros(10)))
    return dict(zip(NAMES, turns, strict=True)), dict(zip(NAMES, places, strict=True))


def pitch(rotations: np.ndarray, name: str) -> float:
    return float(np.degrees(np.arcsin(pose(rotations)[0][name][2, 1])))


def test_only_trunk_head_and_arms_are_touched():
    rotations = hanging()
    before = rotations.copy()
    made = held(rotations, habits(np.full((DRAWN, 1), 0.3)))
    others = [joint for joint in range(22) if joint not in TOUCHED]
    np.testing.assert_array_equal(made[:, :, others], before[:, :, others])
    np.testing.assert_array_equal(rotations, before)
    np.testing.assert_allclose(np.linalg.norm(made, axis=-1), 1, atol=1e-5)


@pytest.mark.parametrize("own", [-1.0, 0.0, 1.5])
@pytest.mark.parametrize("lean", [3.0, 5.0, 20.0, -3.0])
def test_a_trunk_that_leans_forward_is_righted_most_of_the_way(lean, own):
    most = np.degrees(TRUNK_MOST)
    left = lean - min(max(TRUNK_SHARE * (lean - own), 0), most)
    made = held(pitched(hanging(), SPINE, lean), PLAIN._replace(lean=np.radians([own])))
    assert -pitch(made, "spine3") == pytest.approx(left, abs=0.1)


@pytest.mark.parametrize("down", [-10.0, 0.0, 8.0, 25.0])
def test_heads_are_levelled_most_of_the_way(down):
    made = held(pitched(hanging(), NECK, down), PLAIN)
    assert pitch(made, "head") == pytest.approx(LEVEL + 0.4 * (-down - LEVEL), abs=0.5)


def leaning(degrees: np.ndarray) -> np.ndarray:
    """Somebody whose trunk leans forward by so much, frame by frame."""
    rotations = hanging(len(degrees))
    turns = np.radians(-degrees)[:, None] * np.eye(3)[0]
    rotations[0, :, SPINE] = quaternion_from_rotvec(turns)
    return rotations


def leans(rotations: np.ndarray) -> np.ndarray:
    """Degrees [F], frame by frame."""
    return np.array([-pitch(rotations[:, [k]], "spine3") for k in range(rotations.shape[1])])


def test_the_swing_of_the_trunk_within_a_step_is_left_to_it():
    seconds = np.arange(4 * FPS) / FPS
    swing = 4 + 2 * np.sin(2 * np.pi * 2 * seconds)  # two steps a second
    made = leans(held(leaning(swing), PLAIN))[2 * FPS :]
    assert made.mean() == pytest.approx((1 - TRUNK_SHARE) * 4, abs=0.2)
    assert np.ptp(made) > 0.75 * np.ptp(swing)
    slow = leans(held(leaning(np.repeat([0.0, 4.0], [8, 80])), PLAIN))
    assert slow[8] > 3.5 and slow[-1] == pytest.approx((1 - TRUNK_SHARE) * 4, abs=0.1)


def test_frames_in_pieces_are_held_as_all_at_once():
    rotations, own = leaning(np.linspace(-5, 12, 24)), PLAIN
    rest = np.linspace(0, 1, 24, dtype=np.float32)[:, None]
    whole, end = hold(begun(rotations), rotations, own, rest)
    state, parts = begun(rotations), []
    for start in range(0, 24, 8):
        piece = slice(start, start + 8)
        made, state = hold(state, rotations[:, piece], own, rest[piece])
        parts.append(made)
    np.testing.assert_array_equal(np.concatenate(parts, 1), whole)
    np.testing.assert_array_equal([state.lean, state.pitch], [end.lean, end.pitch])


def test_arms_hang_and_swing_as_their_owner_does():
    ahead = hanging()
    for joint in SHOULDERS:
        swung = quaternion_from_rotvec(np.radians([20.0, 0, 0]))
        local = matrix_from_quaternion(swung) @ matrix_from_quaternion(
            ahead[0, 0, joint].astype(np.float64)
        )
        angle = np.arccos(np.clip((np.trace(local) - 1) / 2, -1, 1))
        axis = np.array(
            [local[2, 1] - local[1, 2], local[0, 2] - local[2, 0], local[1, 0] - local[0, 1]]
        )
        ahead[:, :, joint] = quaternion_from_rotvec(axis / (2 * np.sin(angle)) * angle)
    own = PLAIN._replace(
        swing=np.array([1.5]),
        aside=np.radians([[6.0], [6.0]]),
        elbows=np.radians([[20.0], [20.0]]),
    )
    (_, before), (_, after) = pose(held(ahead, PLAIN)), pose(held(ahead, own))
    for side, outwards in (("left", -1), ("right", 1)):
        shoulder, elbow, wrist = (f"{side}_{part}" for part in ("shoulder", "elbow", "wrist"))
        was, now = before[elbow] - before[shoulder], after[elbow] - after[shoulder]
        assert now[1] > was[1] + 0.02, "it swings farther"
        assert outwards * (now[0] - was[0]) > 0.01, "and hangs farther from the body"
        bends = [
            np.degrees(
                np.arccos(
                    (p[elbow] - p[shoulder])
                    @ (p[wrist] - p[elbow])
                    / np.linalg.norm(p[elbow] - p[shoulder])
                    / np.linalg.norm(p[wrist] - p[elbow])
                )
            )
            for p in (before, after)
        ]
        assert bends[1] > bends[0] + 15, "with its elbow bent"


def mid_swing() -> np.ndarray:
    """Somebody whom a walk has left with the left arm ahead, the right one behind, elbows bent."""
    rotations = hanging()
    for joint, elbow, side, swing in zip(
        SHOULDERS, ELBOW_JOINTS, (-1, 1), (35.0, -25.0), strict=True
    ):
        swung = quaternion_from_rotvec(np.radians([swing, 0, 0]))
        rotations[:, :, joint] = multiply(swung, rotations[0, 0, joint])
        rotations[:, :, elbow] = quaternion_from_rotvec(np.radians([0, -20.0 * side, 34.0 * side]))
    return rotations


def test_arms_of_who_rests_hang_at_the_sides_wherever_the_walk_has_left_them():
    walked = mid_swing()
    for rest, most in ((0.0, None), (1.0, 0.09)):
        _, places = pose(held(walked, PLAIN, rest))
        ahead = [places[f"{side}_wrist"][1] - places["pelvis"][1] for side in ("left", "right")]
        aside = [abs(places[f"{side}_wrist"][0]) for side in ("left", "right")]
        if most is None:
            assert max(ahead) > 0.25 and max(ahead) - min(ahead) > 0.2
        else:
            assert max(np.abs(ahead)) < most and max(ahead) - min(ahead) < 0.03
            assert min(aside) > 0.2 and max(aside) < 0.4
            assert places["left_wrist"][2] == pytest.approx(places["right_wrist"][2], abs=0.01)


def test_arms_of_who_leans_hang_straight_down():
    upright, leans = (pose(held(pitched(mid_swing(), SPINE, d), PLAIN, 1.0))[1] for d in (0, 12))
    for side in ("left", "right"):
        arm, leaning = (p[f"{side}_elbow"] - p[f"{side}_shoulder"] for p in (upright, leans))
        assert leaning[1] == pytest.approx(arm[1], abs=0.02)


def test_who_stops_comes_to_rest_in_a_second_and_leaves_faster():
    share, shares = np.zeros(2, np.float32), []
    for chunk in range(20):  # the second one walks on after 2 s
        rests = np.array([True, chunk < 10])
        eased, share = calmed(share, rests, 8)
        shares.append(eased)
    found = np.concatenate(shares)
    assert found[:, 0].argmax() / FPS == pytest.approx(1.2, abs=0.05) and found[-1, 0] == 1
    gone = (found[80:, 1] == 0).argmax() / FPS
    assert gone == pytest.approx(0.6, abs=0.05)
    assert np.abs(np.diff(found, axis=0)).max() < 0.07, "by degrees"
    assert (calmed(np.ones(1, np.float32), np.array([True]), 8)[0] == 1).all()


def test_elbows_at_rest_are_alike_whatever_sign_their_quaternions_have():
    walked = mid_swing()
    turned = walked.copy()
    turned[:, :, ELBOW_JOINTS] *= -1
    for rest in (0.3, 1.0):
        (one, _), (other, _) = pose(held(walked, PLAIN, rest)), pose(held(turned, PLAIN, rest))
        np.testing.assert_allclose(one["left_wrist"], other["left_wrist"], atol=1e-5)


def test_lifted_arms_are_left_to_the_model():
    _, tee = standing(1)
    own = PLAIN._replace(
        swing=np.array([1.5]), aside=np.radians([[6.0], [6.0]]), turned=np.radians([10.0])
    )
    made = held(tee, own)
    np.testing.assert_allclose(made[:, :, SHOULDERS], tee[:, :, SHOULDERS], atol=1e-6)


def test_upper_arms_and_hands_are_turned_alike_on_both_sides():
    own = PLAIN._replace(turned=np.radians([14.0]), hands=np.radians([[20.0], [14.0]]))
    (before, _), (after, _) = pose(held(hanging(), PLAIN)), pose(held(hanging(), own))
    for part, degrees in (("elbow", 14.0), ("wrist", 20.0)):
        turns = [after[f"{side}_{part}"] @ before[f"{side}_{part}"].T for side in ("left", "right")]
        angles = [np.degrees(np.arccos((np.trace(turn) - 1) / 2)) for turn in turns]
        assert angles[0] == pytest.approx(angles[1], abs=0.5) and angles[0] > degrees - 5
        mirrored = np.diag([-1, 1, 1]) @ turns[0] @ np.diag([-1, 1, 1])
        np.testing.assert_allclose(mirrored, turns[1], atol=0.01)


def test_agents_differ_and_rows_do_not_touch_each_other():
    numbers = np.random.default_rng(0).random((DRAWN, 5), np.float32)
    rotations = np.repeat(hanging(3), 5, axis=0)
    rest = np.array([[0, 1, 0.4, 0, 1]], np.float32).repeat(3, 0)
    together, _ = hold(begun(rotations), rotations, habits(numbers), rest)
    for row in range(5):
        one = rotations[row : row + 1]
        alone, _ = hold(begun(one), one, habits(numbers[:, row : row + 1]), rest[:, row : row + 1])
        np.testing.assert_array_equal(alone[0], together[row])
    assert np.ptp(together[:, 0, SHOULDERS[0]], axis=0).max() > 0.01
