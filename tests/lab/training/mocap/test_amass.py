"""AMASS files and body models of the real layouts, made by formula."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.lab.training.mocap.synthetic import AMASS_REST, amass_arrays, write_amass, write_smpl
from wayfarer.body.skeleton import parents
from wayfarer.errors import ArtifactError, DataError
from wayfarer_lab.training.mocap.amass import read_amass
from wayfarer_lab.training.mocap.conversion import to_our_joints
from wayfarer_lab.training.mocap.rig import J

LAYOUTS = ("smplh", "smplx")


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """A user's folder, as the downloads unpack: smplh/male/model.npz, SMPLX_MALE.npz."""
    folder = tmp_path_factory.mktemp("models")
    for layout in LAYOUTS:
        write_smpl(folder, layout, "male")
    return folder


def joints_of(arrays, model) -> np.ndarray:
    """Joints [N, 22, 3] by SMPL's formulae (Loper et al. 2015, Eq. 3 and 10), world of the file."""
    with np.load(model) as file:
        shaped = file["v_template"] + file["shapedirs"][..., :16] @ arrays["betas"]
        rest = (file["J_regressor"] @ shaped)[:22]
    turns = arrays["poses"].reshape(len(arrays["poses"]), -1, 3)
    world, places = [], []
    for j in range(22):
        own = Rotation.from_rotvec(turns[:, j])
        if j == 0:
            world.append(own)
            places.append(arrays["trans"] + rest[0])
            continue
        above = parents()[j]
        world.append(world[above] * own)
        places.append(places[above] + world[above].apply(rest[j] - rest[above]))
    return np.stack(places, 1)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_joints_are_those_of_the_formulae(layout, models, tmp_path) -> None:
    rng = np.random.default_rng(0)
    arrays = amass_arrays(layout, frames=6, fps=100.0)
    arrays["poses"] += rng.normal(0, 0.3, arrays["poses"].shape)
    arrays["betas"] = rng.normal(size=16)
    model = models / {"smplh": "smplh/male/model.npz", "smplx": "SMPLX_MALE.npz"}[layout]
    motion = read_amass(write_amass(tmp_path / "a_poses.npz", arrays), models)
    places, _, _ = to_our_joints(motion, 1.0, "y")
    np.testing.assert_allclose(places, joints_of(arrays, model), atol=1e-9)
    assert motion.fps == 100.0


def test_the_zero_pose_of_an_upright_root_faces_our_way(models, tmp_path) -> None:
    arrays = amass_arrays("smplh", frames=4, fps=100.0)
    motion = read_amass(write_amass(tmp_path / "a.npz", arrays), models)
    places, rotations, rest = to_our_joints(motion, 1.0, "y")
    assert rest[J["right_hip"], 0] > 0.05  # the right is +X, up +Z, toes ahead: facing +Y
    assert rest[J["head"], 2] > 0.4
    assert rest[J["left_foot"], 1] > rest[J["left_ankle"], 1] + 0.05
    # turned upright alone, an AMASS body looks along -Y: half a turn from ours
    np.testing.assert_allclose(rotations[0, 0], np.diag([-1.0, -1, 1]), atol=1e-9)
    assert places[0, J["left_foot"], 1] < places[0, J["left_ankle"], 1]


def test_files_with_few_shape_coefficients_are_read(models, tmp_path) -> None:
    arrays = amass_arrays("smplx", frames=4, fps=60.0)
    arrays["betas"] = np.zeros(300)  # the model of these tests has 20
    motion = read_amass(write_amass(tmp_path / "a_stageii.npz", arrays), models)
    np.testing.assert_allclose(motion.skeleton.offsets[1], AMASS_REST[1] - AMASS_REST[0])


@pytest.mark.parametrize(
    "rates",
    [
        {"mocap_framerate": 60.0, "mocap_frame_rate": 120.0},
        {"mocap_frame_rate": 30.0, "fps": 60.0},
        {"mocap_framerate": 100.0, "mocap_frame_rate": 100.0, "fps": 50.0},
    ],
)
def test_rates_that_contradict_each_other_are_named(rates, models, tmp_path) -> None:
    path = tmp_path / "two_poses.npz"
    np.savez(path, **(without_rate() | {k: np.array(v) for k, v in rates.items()}))
    said = ", ".join(f"{name} {rate:g}" for name, rate in rates.items())
    with pytest.raises(DataError, match=rf"two_poses\.npz: two frame rates .*: {said}"):
        read_amass(path, models)


def test_one_rate_may_be_said_twice_and_in_any_form(models, tmp_path) -> None:
    path = tmp_path / "a_poses.npz"
    same = {"mocap_framerate": np.array([59.94]), "fps": np.array(60)}
    np.savez(path, **(without_rate() | same))
    assert read_amass(path, models).fps == 59.94
    for bad in (np.array([60.0, 60.0]), np.array(0.0), np.array("fast")):
        np.savez(path, **(without_rate() | {"fps": bad}))
        with pytest.raises(DataError, match="fps is"):
            read_amass(path, models)


def without_rate() -> dict[str, np.ndarray]:
    return {k: v for k, v in amass_arrays("smplh", 4, 60.0).items() if k != "mocap_framerate"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"trans": None}, "array trans is missing; found .*poses"),
        ({"poses": np.zeros((4, 72))}, "poses have 72 numbers a frame, expected 156"),
        ({"poses": np.zeros((3, 156))}, r"trans has shape \(4, 3\), expected \(3, 3\)"),
        ({"poses": np.full((4, 156), np.nan)}, "poses has values that are not finite"),
        ({"gender": np.array("child")}, "gender is 'child', expected male, female or neutral"),
        ({"mocap_framerate": None}, "has no mocap_framerate or mocap_frame_rate"),
        ({"surface_model_type": np.array("smplx")}, "156 numbers a frame of smplx"),
        ({"betas": np.array([{}], dtype=object)}, "betas is pickled or damaged"),
    ],
)
def test_another_file_is_refused_by_name(change, message, models, tmp_path) -> None:
    arrays = {k: v for k, v in (amass_arrays("smplh", 4, 100.0) | change).items() if v is not None}
    path = tmp_path / "odd_poses.npz"
    np.savez(path, **arrays)
    with pytest.raises(DataError, match=rf"odd_poses\.npz: .*{message}"):
        read_amass(path, models)


def test_what_is_no_archive_is_refused(models, tmp_path) -> None:
    path = tmp_path / "cut.npz"
    write_amass(path, amass_arrays("smplh", 4, 100.0))
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(DataError, match=r"cut\.npz: cannot be read as npz"):
        read_amass(path, models)


def test_a_missing_body_model_is_told_with_its_place(models, tmp_path) -> None:
    path = write_amass(tmp_path / "a.npz", amass_arrays("smplx", 4, 60.0))
    with pytest.raises(ArtifactError, match=r"SMPLX_MALE\.npz.*--smpl-models"):
        read_amass(path, None)
    with pytest.raises(ArtifactError, match=r"holds no male smplx body; expected SMPLX_MALE\.npz"):
        read_amass(path, tmp_path)
