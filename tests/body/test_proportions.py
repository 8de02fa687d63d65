"""Betas from the joints of a character."""

import numpy as np
import pytest

from wayfarer.body.library import load_body
from wayfarer.body.proportions import BOUND, REQUIRED, fit_betas
from wayfarer.errors import InvalidArgument
from wayfarer.spec import GENDERS, POSED_JOINTS

LEG_CM = dict.fromkeys(("thigh", "shin", "ankle_height", "foot"), 0.7)


def joints_of(gender: str, betas) -> dict[str, np.ndarray]:
    body = load_body("anny52", gender)
    rest = body.rest_joints(np.asarray(betas, float))
    return dict(zip(body.joint_names[:POSED_JOINTS], rest, strict=False))


@pytest.mark.parametrize("gender", GENDERS)
@pytest.mark.parametrize("seed", range(8))
def test_our_own_bodies_come_back(gender, seed):
    """Legs within 7 mm, the rest within 2 cm; the rest is average."""
    betas = np.clip(np.random.default_rng(seed).normal(size=10), -2.5, 2.5)
    joints = joints_of(gender, betas)
    found = fit_betas(joints, floor=0.0, gender=gender)
    assert found.scale == 1.0 and found.gender == gender
    again = joints_of(gender, found.betas)
    for length in found.lengths:
        assert abs(length.error_cm) < LEG_CM.get(length.name, 2.0), length
    for bone in (*REQUIRED, "left_foot"):
        assert np.linalg.norm(again[bone] - joints[bone]) < 0.015
    assert np.abs(found.betas).max() <= BOUND


def test_a_body_does_not_depend_on_where_and_how_the_character_stands():
    joints = joints_of("female", [1.0] + [0.0] * 9)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    moved = {bone: turn @ place + [3.0, -7.0, 2.0] for bone, place in joints.items()}
    moved["left_elbow"] = moved["left_shoulder"] + [  # an arm that hangs
        0, 0, -np.linalg.norm(joints["left_elbow"] - joints["left_shoulder"])
    ]  # fmt: skip
    del moved["left_wrist"], moved["right_wrist"]
    del joints["left_wrist"], joints["right_wrist"]
    np.testing.assert_allclose(fit_betas(moved).betas, fit_betas(joints).betas, atol=1e-3)


@pytest.mark.parametrize("gender", GENDERS)
def test_the_gender_that_fits_better_is_found(gender):
    assert fit_betas(joints_of(gender, np.zeros(10)), floor=0.0).gender == gender


@pytest.mark.parametrize("size", [0.1, 0.4, 2.0, 10.0])
def test_a_character_of_another_size_has_its_proportions_and_a_scale(size):
    joints = joints_of("male", [0.5, -0.5] + [0.0] * 8)
    found = fit_betas({bone: size * place for bone, place in joints.items()}, 0.0, "male")
    # 1.5: the prior draws towards the mean body and towards scale 1
    assert size / 1.25 < found.scale < size * 1.25
    for length in found.lengths:
        assert abs(length.error_cm) < 2.0 * size, length


def test_legs_alone_are_enough():
    joints = joints_of("female", np.zeros(10))
    found = fit_betas({bone: joints[bone] for bone in REQUIRED})
    assert [length.name for length in found.lengths] == ["thigh", "shin", "hips"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"left_knee": None}, "left_knee missing"),
        ({"tail": np.zeros(3)}, "'tail' is no bone"),
        ({"head": np.array([np.nan, 0, 0])}, "head: a place is 3 finite numbers"),
        ({"head": np.array([0.0, 0, 500])}, "the joints are .* m apart"),
        ({"left_ankle": np.array([30.0, 0, 0])}, "the left leg is .* m long"),
        (
            {"left_knee": joints_of("female", np.zeros(10))["left_hip"] + 0.01},
            "one of the joints is another bone's",
        ),
    ],
)
def test_what_cannot_be_a_character_is_refused(change, message):
    joints = {**joints_of("female", np.zeros(10)), **change}
    with pytest.raises(InvalidArgument, match=message):
        fit_betas({bone: place for bone, place in joints.items() if place is not None})


@pytest.mark.parametrize("floor", [0.5, -3.0])
def test_a_floor_that_is_elsewhere_is_refused(floor):
    with pytest.raises(InvalidArgument, match="over the floor") as caught:
        fit_betas(joints_of("female", np.zeros(10)), floor)
    assert caught.value.field == "floor"
