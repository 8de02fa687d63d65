import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.world.output.legwork import legs, standing
from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.world.output.legs import KNEES, LegPose, Legs, pose_legs
from wayfarer.world.output.quaternion import length
from wayfarer.world.output.twobone import FOLD, STRETCH, move_ankles, reach

CENTIMETRES = st.floats(-0.08, 0.08)


def moved_pose(
    bend: float, shift: np.ndarray, shape: Legs | None = None, beside: tuple[int, float] = (1, 0.0)
) -> tuple[LegPose, LegPose]:
    """The pose before and after both ankles are moved by `shift` [3]; `beside`: index and value of
    a component of both knees' rotations.
    """
    shape = shape or legs()
    translation, rotations = standing(1, bend)
    rotations[:, :, KNEES, beside[0]] = beside[1]
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    before = pose_legs(shape, translation, rotations)
    move_ankles(before, np.zeros_like(before.ankle) + np.float32(shift), rotations)
    np.testing.assert_allclose(np.linalg.norm(rotations, axis=-1), 1, atol=1e-5)
    return before, pose_legs(shape, translation, rotations)


def turned_side(pose: LegPose) -> np.ndarray:
    """Bend of the shins in the direction of knees [2, F, A], times both lengths."""
    thigh, shin = (pose.knee - pose.hip).T, (pose.ankle - pose.knee).T
    side = -matrix_from_quaternion(pose.hip_turn)[..., 0].T
    return (np.cross(thigh, shin, axis=0) * side).sum(0)


@settings(max_examples=50, deadline=None)
@given(st.tuples(CENTIMETRES, CENTIMETRES, CENTIMETRES), st.floats(1.6, 2.0))
def test_ankles_go_where_they_are_sent_and_feet_keep_their_turn(shift, bend):
    before, after = moved_pose(bend, np.array(shift))
    want = before.ankle + np.float32(shift)
    np.testing.assert_allclose(after.ankle, want, atol=1e-4)
    np.testing.assert_allclose(after.ankle_turn, before.ankle_turn, atol=1e-5)
    np.testing.assert_allclose(after.hip, before.hip)


@pytest.mark.parametrize("shift", [(0, 0.05, 0), (0, -0.05, 0.02), (0, 0, 0.08)])
def test_a_move_in_the_plane_of_the_knee_keeps_it_in_that_plane(shift):
    before, after = moved_pose(1.0, np.array(shift))
    np.testing.assert_allclose(after.knee[..., 0], before.knee[..., 0], atol=1e-4)
    assert (after.knee[..., 1] > after.hip[..., 1]).all(), "it bends forwards, as before"


@pytest.mark.parametrize("bend", [0.0, 1e-4, 0.02])
def test_a_straight_knee_bends_forwards(bend):
    before, after = moved_pose(bend, np.array([0, 0, 0.05]))
    np.testing.assert_allclose((after.ankle - before.ankle)[0, 0], [[0, 0, 0.05]] * 2, atol=1e-3)
    assert (turned_side(after) > 0).all()


def test_the_least_turn_beside_its_bend_does_not_swing_a_straight_knee_about():
    knees = [
        moved_pose(0.02, np.array([0, 0, 0.03]), beside=(2, turn))[1].knee for turn in (-0.03, 0.03)
    ]
    assert np.abs(knees[1] - knees[0]).max() < 0.06, "17 cm if the plane were taken from that"


@pytest.mark.parametrize("bend", [-0.02, -0.1, -0.3])
def test_a_knee_beyond_straight_is_bent_forwards_again(bend):
    before, after = moved_pose(bend, np.array([0.01, 0.02, 0.01]))
    assert (turned_side(after) > -1e-3).all()
    np.testing.assert_allclose(after.ankle_turn, before.ankle_turn, atol=1e-5)


@pytest.mark.parametrize("bend", [-0.08, 0.0, 0.02])
@pytest.mark.parametrize("beside", [-0.3, 0.3])
def test_a_knee_turned_sideways_is_not_stretched_beyond_straight(bend, beside):
    """The hinge does not subtract the sideways turn, which once made knees of -7 degrees."""
    _, after = moved_pose(bend, np.array([0, 0, -0.05]), beside=(1, beside))
    assert (turned_side(after) > -1e-3).all()


def bends(pose: LegPose) -> np.ndarray:
    """Degrees by which knees are bent about their hinge."""
    thigh, shin = (pose.knee - pose.hip).T, (pose.ankle - pose.knee).T
    return np.degrees(np.arctan2(turned_side(pose), (thigh * shin).sum(0)))


def test_a_straight_knee_does_not_jump_as_its_foot_is_lifted():
    """The foot rises by 3 mm and 9 more; once a nearly straight knee then bent by 10 degrees."""
    heights = [0.0, 0.0, 0.0033, 0.0125]
    bent = [bends(moved_pose(0.0, np.array([0, 0, height]))[1]).max() for height in heights]
    assert bent[0] == pytest.approx(4, abs=0.1)
    assert np.diff(bent, 2).max() < 7


@pytest.mark.parametrize("bend", [-0.02, 0.0, 0.02, 0.05, 0.1])
def test_a_knee_that_is_kept_from_straight_moves_its_foot_by_half_a_millimetre(bend):
    before, after = moved_pose(bend, np.zeros(3))
    assert length((after.ankle - before.ankle).T).max() < 6e-4


def test_no_move_changes_nothing():
    before, after = moved_pose(0.5, np.zeros(3))
    for name in ("hip_turn", "knee_turn", "ankle_turn"):
        np.testing.assert_allclose(getattr(after, name), getattr(before, name), atol=1e-6)


def test_what_is_out_of_reach_is_approached_without_a_snap():
    """The farther the target, the straighter the knee, and it never gets quite straight."""
    leg = float((length(legs().knee[0].T) + length(legs().ankle[0].T))[0])
    reached = [
        float(length((after.ankle - after.hip).T).max())
        for _, after in (moved_pose(0.4, np.array([0, 0, -far])) for far in np.linspace(0, 0.5, 20))
    ]
    assert np.diff(reached).min() >= -1e-6
    assert max(reached) < leg * (STRETCH + 1e-4)
    assert max(np.diff(reached)) < 0.5 / 19 + 1e-4


@given(
    st.floats(0.2, 0.9), st.floats(0.05, 1.5), st.floats(0.5, 0.9), st.floats(1e-3, 0.05)
)  # metres
def test_reach(before, wanted, leg, more):
    def taken(distance: float) -> float:
        return float(reach(before, distance, leg))

    assert taken(before) == pytest.approx(before)
    assert taken(wanted) <= taken(wanted + more) + 1e-12
    assert taken(wanted) <= max(before, STRETCH * leg) + 1e-5
    assert taken(wanted) >= min(before, FOLD * leg)
    if wanted > before:
        assert taken(wanted) <= wanted + 1e-12


@pytest.mark.parametrize("column", ["knee", "ankle", "hip"])
def test_bones_without_length_give_no_nan(column):
    shape = legs()
    getattr(shape, column)[:] = 0
    _, after = moved_pose(0.3, np.array([0.02, 0.03, 0.01]), shape)
    assert np.isfinite(after.soles).all()
