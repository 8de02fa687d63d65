from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tests.wire_poses import quaternions_to_core, quaternions_to_wire
from wayfarer.transport.conversion.basis import Basis

bases = st.sampled_from(list(Basis))
points = arrays(np.float64, (5, 3), elements=st.floats(-1e4, 1e4))
unit = arrays(np.float64, (5, 4), elements=st.floats(-1, 1)).filter(
    lambda q: (np.linalg.norm(q, axis=-1) > 0.1).all()
)


def normalise(q):
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def multiply(a, b):
    """Hamilton product of x, y, z, w."""
    va, wa, vb, wb = a[..., :3], a[..., 3:], b[..., :3], b[..., 3:]
    vector = wa * vb + wb * va + np.cross(va, vb)
    return np.concatenate([vector, wa * wb - (va * vb).sum(-1, keepdims=True)], -1)


def rotate(q, p):
    zero = np.zeros((*p.shape[:-1], 1))
    conjugate = q * [-1, -1, -1, 1]
    return multiply(multiply(q, np.concatenate([p, zero], -1)), conjugate)[..., :3]


@given(bases, points, unit)
def test_round_trip(basis, place, turn):
    axes = basis.axes
    np.testing.assert_allclose(axes.points_to_core(axes.points_to_wire(place)), place, atol=1e-9)
    back = quaternions_to_core(axes, quaternions_to_wire(axes, turn))
    np.testing.assert_array_equal(back, turn)
    assert axes.heading_to_core(axes.heading_to_wire(0.7)) == 0.7
    assert axes.length_to_core(axes.length_to_wire(0.3)) == pytest.approx(0.3)


@given(bases, unit, unit, points)
def test_conversion_keeps_what_rotations_do(basis, a, b, place):
    """Rotating, then converting = converting, then rotating; products are kept too."""
    axes, a, b = basis.axes, normalise(a), normalise(b)
    to = partial(quaternions_to_wire, axes)
    np.testing.assert_allclose(to(multiply(a, b)), multiply(to(a), to(b)), atol=1e-12)
    np.testing.assert_allclose(
        axes.points_to_wire(rotate(a, place)),
        rotate(to(a), axes.points_to_wire(place)),
        atol=1e-6,
    )


@given(bases, st.floats(-3, 3))
def test_heading_is_the_bases_own_turn_about_up(basis, heading):
    """The quaternion of the wire heading about the wire's up takes forward to where it faces."""
    axes = basis.axes
    half = axes.heading_to_wire(heading) / 2
    turn = np.append(axes.up * np.sin(half), np.cos(half))
    facing = axes.matrix @ (-np.sin(heading), np.cos(heading), 0.0)
    np.testing.assert_allclose(rotate(turn, axes.forward), facing, atol=1e-12)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("basis", Basis)
def test_keeps_the_type(basis, dtype):
    assert basis.axes.points_to_wire(np.ones((2, 3), dtype)).dtype == dtype
    assert quaternions_to_wire(basis.axes, np.ones((2, 4), dtype)).dtype == dtype
