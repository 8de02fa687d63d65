"""The tilt of trunks that lean by known angles."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.lab.evaluation.people import BODIES
from tests.world.fakes import BODIES as STICKS
from wayfarer.body.library import load_body
from wayfarer.body.rotation import matrix_from_quaternion, quaternion_from_rotvec
from wayfarer.errors import InvalidArgument
from wayfarer.spec import BETAS
from wayfarer_lab.evaluation.gait import Windows, lean
from wayfarer_lab.evaluation.metrics.trunk import Trunk

BODY = BODIES["female"]
ANGLE = st.floats(-np.pi, np.pi)


def turned(points: np.ndarray, rotvec: list[float]) -> np.ndarray:
    return points @ matrix_from_quaternion(quaternion_from_rotvec(np.array(rotvec))).T


@given(lean=st.floats(0, 60), yaw=ANGLE, side=st.sampled_from([(1, 0), (0, 1)]))
def test_a_lean_to_any_side_counts_and_a_turn_does_not(
    lean: float, yaw: float, side: tuple[int, int]
) -> None:
    x, y = np.radians(lean) * np.array(side)
    leaning = turned(BODY.rest_vertices(np.zeros(BETAS), BODY.marker_vertices), [x, y, 0.0])
    assert Trunk.of(BODY).tilt(turned(leaning, [0, 0, yaw])) == pytest.approx(lean, abs=1e-4)


@pytest.mark.parametrize("gender", ["male", "female"])
def test_a_t_pose_of_any_shape_does_not_tilt(gender: str) -> None:
    body = load_body("anny52", gender, "low")
    for betas in np.random.default_rng(0).uniform(-2, 2, (5, BETAS)):
        markers = body.rest_vertices(betas, body.marker_vertices)
        assert Trunk.of(body, betas).tilt(markers) == pytest.approx(0.0, abs=1e-3)
        assert Trunk.of(body).tilt(markers) < 3.0, "the mean body's trunk will do for mixed rows"


def test_a_body_without_the_markers_is_refused() -> None:
    stick = STICKS["female"]
    unnamed = replace(stick, marker_names=tuple(f"M{k}" for k in range(len(stick.marker_names))))
    with pytest.raises(InvalidArgument, match="LFWT"):
        Trunk.of(unnamed)


def test_gait_rows_tell_the_tilt_where_there_is_motion() -> None:
    rest = BODY.rest_vertices(np.zeros(BETAS), BODY.marker_vertices)
    markers = np.tile(turned(rest, [np.radians(10), 0, 0]), (80, 1, 1))
    motion = Windows.cut(markers, np.zeros((80, 3)))
    trunk = Trunk.of(BODY)
    assert lean({}, motion, trunk)["trunk_tilt_deg"] == pytest.approx(10.0, abs=1e-4)
    assert lean({}, motion.at_walking_speed(), trunk) == {}
