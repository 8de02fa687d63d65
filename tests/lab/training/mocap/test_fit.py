"""The fit, on motion made with our own body: the result must equal the input."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wayfarer.body.library import load_body
from wayfarer.spec import POSED_JOINTS
from wayfarer_lab.training.mocap.fit import FitOptions, Fitter
from wayfarer_lab.training.mocap.retarget import Subject, bend_knee, make_problem
from wayfarer_lab.training.mocap.rig import ClipInfo, J, SourceClip
from wayfarer_lab.training.mocap.shape import own_shape, segment_lengths


@pytest.fixture(scope="module")
def body():
    return load_body("anny52", "female")


def squats(body, betas: np.ndarray, frames: int = 60) -> SourceClip:
    """Somebody of this shape bends knees and raises arms, feet flat on the floor."""
    rest = body.rest_joints(betas)
    phase = (1 - np.cos(np.linspace(0, 2 * np.pi, frames))) / 2
    local = np.broadcast_to(np.eye(3), (frames, POSED_JOINTS, 3, 3)).copy()

    def turn(joint: str, axis: str, degrees: np.ndarray) -> None:
        local[:, J[joint]] = Rotation.from_euler(axis, degrees[:, None], degrees=True).as_matrix()

    for side, sign in (("left", 1), ("right", -1)):
        turn(f"{side}_hip", "x", 35 * phase)
        turn(f"{side}_knee", "x", -70 * phase)
        turn(f"{side}_ankle", "x", 35 * phase)
        turn(f"{side}_shoulder", "y", -sign * (70 - 40 * phase))
    _, places = body.forward_kinematics(np.zeros((frames, 3)), local, rest)
    rotations, _ = body.forward_kinematics(np.zeros((frames, 3)), local, rest)
    ankles = places[:, [J["left_ankle"], J["right_ankle"]]].mean(1)
    places = places + (rest[[J["left_ankle"], J["right_ankle"]]].mean(0) - ankles)[:, None]
    places[..., 2] -= rest[J["left_foot"], 2]  # floor convention of SourceClip
    contacts = np.ones((frames, 2, 2), bool)
    info = ClipInfo("squat", "squat", "s")
    return SourceClip(info, places[:, :22], rotations[:, :22], rest[:22], contacts)


def subject_of(clip: SourceClip) -> Subject:
    up = np.array([[0, 0, 1.0], [0, 0, 1.0]])
    return Subject(float(clip.places[0, J["left_ankle"], 2]), np.deg2rad(5), up)


def test_own_shape_finds_the_proportions(body) -> None:
    betas = np.linspace(-1, 1, 10)
    rest = body.rest_joints(betas)
    found = body.rest_joints(own_shape(body, rest[:22]).betas)
    assert np.abs(segment_lengths(found) - segment_lengths(rest)).max() < 0.012


def test_motion_of_our_own_body_comes_back(body) -> None:
    clip = squats(body, np.linspace(-1, 1, 10))
    shape = own_shape(body, clip.rest)
    problem = make_problem(clip, subject_of(clip), body, shape)
    fitted = Fitter(body, FitOptions(steps=60)).fit([problem])[0]
    assert np.nanmean(fitted.joint_error) < 0.01
    assert fitted.rotations.shape == (60, 22, 4)
    np.testing.assert_allclose(np.linalg.norm(fitted.rotations, axis=-1), 1, atol=1e-5)


def test_the_fit_pins_feet_and_does_not_mix_clips(body) -> None:
    clip = squats(body, np.zeros(10))
    sliding = SourceClip(
        clip.info,
        clip.places + np.linspace(0, 0.2, len(clip))[:, None, None] * [1, 0, 0],
        clip.rotations,
        clip.rest,
        clip.contacts,
    )
    shape = own_shape(body, clip.rest)
    still, moving = (make_problem(c, subject_of(clip), body, shape) for c in (clip, sliding))
    fitter = Fitter(body, FitOptions(steps=80))

    def slide(fit) -> float:
        local = Rotation.from_quat(fit.rotations.reshape(-1, 4)).as_matrix().reshape(-1, 22, 3, 3)
        rest = body.rest_joints(shape.betas)
        _, places = body.forward_kinematics(fit.translation, local, rest)
        return float(np.ptp(places[:, J["left_foot"], 0]))

    copied = fitter.fit([moving], refine=False)[0]
    alone = fitter.fit([moving])[0]
    beside = fitter.fit([still, moving])[1]
    assert slide(copied) > 0.19
    assert slide(alone) < 0.08
    np.testing.assert_allclose(beside.translation, alone.translation, atol=0.02)


def test_knees_reach_both_ends_and_bend_to_the_hint() -> None:
    hip, ankle = np.array([[0, 0, 0.8]]), np.array([[0, 0.1, 0.1]])
    knee = bend_knee(hip, ankle, np.array([[0, 0.5, 0.4]]), 0.4, 0.42)
    assert np.linalg.norm(knee - hip) == pytest.approx(0.4, abs=1e-6)
    assert np.linalg.norm(knee - ankle) == pytest.approx(0.42, abs=1e-6)
    assert knee[0, 1] > 0.1
    far = bend_knee(hip, hip - np.array([0, 0, 2.0]), hip + np.array([0, 0.1, 0]), 0.4, 0.4)
    np.testing.assert_allclose(far, hip - np.array([0, 0, 1.0]), atol=0.03)
