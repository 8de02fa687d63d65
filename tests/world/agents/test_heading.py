import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.world.agents.heading import angle_between, facing_at, facing_of, heading_of

angles = st.floats(-3.1, 3.1)


def turned(heading, lean=0.0):
    """Hips that lean forward by `lean` about their right side, then turn about +Z."""
    z, w = np.sin(heading / 2), np.cos(heading / 2)
    x, v = np.sin(lean / 2), np.cos(lean / 2)
    return np.array([w * x, z * x, z * v, w * v])


@given(angles, st.floats(-1.2, 1.2))
def test_leaning_does_not_change_the_heading(heading, lean):
    assert heading_of(turned(heading, lean)) == pytest.approx(heading, abs=1e-5)
    np.testing.assert_allclose(facing_of(turned(heading, lean)), facing_at(heading), atol=1e-6)


@given(angles, angles)
def test_angles_between(a, b):
    apart = abs((a - b + np.pi) % (2 * np.pi) - np.pi)
    one, other = np.array([facing_at(a)]), np.array([facing_at(b)])
    assert angle_between(one, other)[0] == pytest.approx(apart, abs=1e-3)


def test_heading_zero_faces_y_and_turns_counter_clockwise():
    assert facing_at(0.0) == pytest.approx((0, 1))
    assert facing_at(np.pi / 2) == pytest.approx((-1, 0))
