"""Crowds that march, and crowds that do not."""

import numpy as np
import pytest

from wayfarer.body.rotation import quaternion_from_rotvec
from wayfarer_lab.evaluation.metrics import crowd


def test_a_march_is_in_order_and_a_crowd_is_not() -> None:
    march = np.tile(np.linspace(0, 1, 20, endpoint=False), (8, 1))
    assert crowd.phase_order(march) == pytest.approx(1.0)
    spread = march + np.arange(8)[:, None] / 8
    assert crowd.phase_order(spread) == pytest.approx(0.0, abs=1e-9)
    halves = march + 0.5 * (np.arange(8)[:, None] % 2)
    assert crowd.phase_order(halves) == pytest.approx(0.0, abs=1e-9)
    late = march.copy()
    late[0] = np.nan
    assert crowd.phase_order(late) == pytest.approx(1.0), "who has no phase does not count"
    assert np.isnan(crowd.phase_order(np.full((3, 4), np.nan))).all()


def swings(degrees: float, frames: int = 80, period: int = 20) -> np.ndarray:
    """Local rotations [T, 2, 4]: one joint swings, the other does not."""
    turns = np.zeros((frames, 2, 3))
    turns[:, 0, 0] = np.radians(degrees) * np.sin(2 * np.pi * np.arange(frames) / period)
    return quaternion_from_rotvec(turns)


def test_clones_have_no_spread_and_others_their_standard_deviation() -> None:
    strikes = np.arange(0, 80, 20)
    one = crowd.mean_cycle(swings(10.0), strikes)
    assert one is not None and one.shape == (crowd.PHASES, 2, 4)
    assert crowd.cycle_spread([one, one, one]) == pytest.approx(0, abs=1e-5)
    turned = quaternion_from_rotvec(np.radians([[[0.0, 0, -6]], [[0.0, 0, 0]], [[0.0, 0, 6]]]))
    people = [np.broadcast_to(q, (crowd.PHASES, 1, 4)) for q in turned]
    assert crowd.cycle_spread(people) == pytest.approx(6 / np.sqrt(3), rel=1e-3), (
        "one axis of three"
    )


def test_a_cycle_is_the_mean_of_its_strides() -> None:
    small, large = swings(10.0, 20), swings(20.0, 20)
    both = crowd.mean_cycle(np.concatenate([small, large, small]), np.array([0, 20, 40]))
    middle = crowd.mean_cycle(swings(15.0), np.array([0, 20, 40]))
    assert both == pytest.approx(middle, abs=1e-3)
    assert crowd.mean_cycle(small, np.array([3])) is None
