"""Contact measures on made motions whose right answers are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.spec import FPS
from wayfarer_lab.evaluation.metrics import contact

FRAMES = 40


def standing(frames: int = FRAMES) -> np.ndarray:
    """Eight sole markers at rest on the floor and one at 1 m: [T, 9, 3], left foot first."""
    spots = [[side, toe * 0.05, 0.0] for side in (-0.1, 0.1) for toe in range(4)]
    body = np.array([*spots, [0.0, 0.0, 1.0]])
    return np.tile(body, (frames, 1, 1))


def moving(points: np.ndarray, velocity: tuple[float, float, float]) -> np.ndarray:
    time = np.arange(len(points))[:, None, None] / FPS
    return points + time * np.array(velocity)


def test_standing_still_is_perfect() -> None:
    motion = standing()
    assert contact.paper_contact(motion[:10]) == 1.0
    assert (contact.strict_contact(motion[:, :8]) == 1.0).all()
    assert contact.slide_speed(motion[:, :8]) == 0.0
    assert not contact.both_feet_skating(motion[:, :8]).any()
    assert contact.penetration(motion).max() == 0.0
    assert contact.clearance(motion).max() == 0.0


@given(speed=st.floats(0.0, 3.0), angle=st.floats(0.0, 6.28))
def test_a_sliding_body_scores_its_speed(speed: float, angle: float) -> None:
    motion = moving(standing(), (speed * np.cos(angle), speed * np.sin(angle), 0.0))
    soles = motion[:, :8]
    assert contact.slide_speed(soles) == pytest.approx(speed, abs=1e-9)
    expected = np.exp(-max(speed - 0.075, 0.0))
    assert contact.strict_contact(soles) == pytest.approx(np.full(FRAMES, expected))
    assert contact.paper_contact(motion[:10]) == pytest.approx(expected)
    if abs(speed - contact.SKATE_SPEED) > 1e-6:
        assert contact.both_feet_skating(soles).all() == (speed > contact.SKATE_SPEED)


def test_heels_skate_when_both_are_low_and_fast() -> None:
    heels = moving(np.tile([[-0.1, 0.0, 0.03], [0.1, 0.0, 0.03]], (FRAMES, 1, 1)), (0.0, 0.1, 0.0))
    assert contact.heel_skating(heels, 0.075).shape == (FRAMES - 1,)
    assert contact.heel_skating(heels, 0.075).all()
    assert not contact.heel_skating(heels, 0.2).any()
    raised = heels.copy()
    raised[:20, 1, 2] = 0.06
    assert contact.heel_skating(raised, 0.075).tolist() == [False] * 19 + [True] * 20
    planted = heels.copy()
    planted[:, 0] = planted[0, 0]
    assert not contact.heel_skating(planted, 0.075).any()


def test_one_planted_foot_is_no_double_skating() -> None:
    motion = standing()
    motion[:, :4] = moving(motion[:, :4], (0.0, 1.0, 0.0))
    assert not contact.both_feet_skating(motion[:, :8]).any()
    assert (contact.strict_contact(motion[:, :8]) == 1.0).all()


@given(lift=st.floats(0.0, 0.5))
def test_a_lifted_body_floats(lift: float) -> None:
    motion = standing() + np.array([0.0, 0.0, lift])
    assert contact.clearance(motion) == pytest.approx(np.full(FRAMES, lift))
    assert contact.penetration(motion).max() == 0.0
    expected = np.exp(-max(lift - 0.05, 0.0))
    assert contact.strict_contact(motion[:, :8]) == pytest.approx(np.full(FRAMES, expected))


def test_slide_is_not_measured_in_the_air() -> None:
    lifted = standing() + np.array([0.0, 0.0, 0.1])
    assert np.isnan(contact.slide_speed(lifted[:, :8]))


@given(depth=st.floats(0.0, 0.5))
def test_penetration_is_the_depth_of_the_lowest_marker(depth: float) -> None:
    motion = standing()
    motion[:20, 3, 2] -= depth
    measured = contact.penetration(motion)
    assert measured[:20] == pytest.approx(np.full(20, depth))
    assert measured[20:].max() == 0.0


def test_the_paper_score_saturates_where_the_strict_one_does_not() -> None:
    """One still marker in one frame satisfies Eq. 11; that is why it is no gate."""
    sliding = moving(standing(), (0.0, 1.0, 0.0))
    sliding[:, 8] = (0.0, 0.0, 0.04)  # a marker that hangs still near the floor, not a sole
    assert contact.paper_contact(sliding[:10]) == 1.0
    assert contact.strict_contact(sliding[:, :8]).max() < 0.4


def test_a_clip_is_scored_by_whole_primitives() -> None:
    half = standing(20)
    half[10:] = moving(standing(10), (1.0, 0.0, 0.0))
    still_then_sliding = np.concatenate([half, standing(7)])  # the last 7 frames do not count
    first, second = contact.paper_contact(half[:10]), contact.paper_contact(half[10:20])
    assert contact.paper_contact_of_clip(still_then_sliding) == pytest.approx((first + second) / 2)
