"""Arms whose pose is written down."""

import numpy as np
import pytest

from wayfarer_lab.evaluation.metrics import arms

CHEST = np.eye(3)[None]


def arm(upper: list[float], fore: list[float]) -> tuple[np.ndarray, ...]:
    """Shoulders, elbows and wrists [1, 2, 3] of a left arm along these vectors, and its mirror."""
    mirror = np.array([[1.0, 1, 1], [-1.0, 1, 1]])
    shoulders = np.array([[-0.2, 0, 1.4], [0.2, 0, 1.4]])
    elbows = shoulders + 0.3 * np.array(upper) * mirror
    wrists = elbows + 0.25 * np.array(fore) * mirror
    return shoulders[None], elbows[None], wrists[None]


def test_elbows_bend_by_the_angle_between_the_bones() -> None:
    assert arms.elbow_bend(*arm([0, 0, -1], [0, 0, -1]))[0] == pytest.approx([0, 0], abs=1e-5)
    assert arms.elbow_bend(*arm([0, 0, -1], [0, 1, 0]))[0] == pytest.approx([90, 90])


@pytest.mark.parametrize(
    ("upper", "degrees"),
    [([0, 0, -1], 0), ([-1, 0, 0], 90), ([-0.5, 0, -(0.75**0.5)], 30), ([0, 1, 0], 0)],
)
def test_upper_arms_are_away_by_their_outward_part(upper: list[float], degrees: float) -> None:
    shoulders, elbows, _ = arm(upper, [0, 0, -1])
    assert arms.outward(shoulders, elbows, CHEST)[0] == pytest.approx([degrees] * 2, abs=1e-4)


def test_the_body_may_face_anywhere() -> None:
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # facing -X
    shoulders, elbows, _ = arm([-1, 0, 0], [0, 0, -1])
    turned = arms.outward(shoulders @ quarter.T, elbows @ quarter.T, quarter[None])
    assert turned[0] == pytest.approx([90, 90])


def test_swing_is_taken_along_the_facing_against_the_chest() -> None:
    time = np.arange(400) / 40
    wrists = np.zeros((400, 2, 3))
    wrists[..., 0] = 0.1 * np.sin(2 * np.pi * time)[:, None] + 1.3 * time[:, None]
    chest = np.stack([1.3 * time, 0 * time, 0 * time], -1)
    facing = np.broadcast_to([1.0, 0.0], (400, 2))
    ahead = arms.ahead_of(wrists, chest, facing)
    assert arms.swing_range(ahead) == pytest.approx(0.2, rel=0.02)
    assert arms.swing_range(0 * ahead) == 0


def test_arms_go_with_the_opposite_legs() -> None:
    phase = np.linspace(0, 20, 400)
    legs = np.stack([np.sin(phase), -np.sin(phase)], -1)
    assert arms.against_legs(-legs, legs) == pytest.approx(1)
    assert arms.against_legs(legs, legs) == pytest.approx(-1)
    assert np.isnan(arms.against_legs(0 * legs, legs)), "a statue"


def test_lifted_arms() -> None:
    for upper, fore, lifted in (
        ([0, 0, -1], [0, 0, -1], False),
        ([-1, 0, 0], [0, 0, -1], True),
        ([0, 0.6, -0.8], [0, 0, 1.0], True),
    ):
        shoulders, elbows, wrists = arm(upper, fore)
        away = arms.outward(shoulders, elbows, CHEST)
        if lifted and upper[0] == 0:
            wrists[..., 2] += 0.1
        assert arms.lifted(shoulders, wrists, away)[0] == lifted
