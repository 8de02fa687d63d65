"""The SMPL-X loader on a synthetic file of that layout, against SMPL's formulae in its frame."""

import json

import numpy as np
import pytest

from tests.body.smplx_files import FILE_NAMES, smplx_arrays
from wayfarer.body import landmarks, skeleton, smplx
from wayfarer.body.library import SMPLX_FOLDER, load_body
from wayfarer.body.rotation import GLTF_FROM_CORE, matrix_from_quaternion, quaternion_from_rotvec
from wayfarer.errors import ArtifactError

AXES = GLTF_FROM_CORE


@pytest.fixture(scope="module")
def arrays():
    return smplx_arrays()


def written(tmp_path, arrays, **changes):
    path = tmp_path / "SMPLX_FEMALE.npz"
    np.savez(path, **{n: v for n, v in (arrays | changes).items() if v is not None})
    return path


@pytest.fixture(scope="module")
def path(tmp_path_factory, arrays):
    return written(tmp_path_factory.mktemp("smplx"), arrays)


def rotations(rotvec):
    return matrix_from_quaternion(quaternion_from_rotvec(rotvec))


def reference(arrays, betas, rotvec, translation):
    """SMPL's own formulae (Loper et al. 2015, Eq. 2-10), in the file's frame and joint order."""
    shaped = arrays["v_template"] + arrays["shapedirs"][..., : len(betas)] @ betas
    joints = arrays["J_regressor"] @ shaped
    local = rotations(rotvec)
    posed = shaped + arrays["posedirs"] @ (local[1:] - np.eye(3)).ravel()
    parents = arrays["kintree_table"][0]
    world = [np.block([[local[0], joints[0][:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])]
    for j in range(1, 55):
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = local[j], joints[j] - joints[parents[j]]
        world.append(world[parents[j]] @ step)
    world = np.array(world)
    moved = world[:, :3, 3] - np.einsum("jab,jb->ja", world[:, :3, :3], joints)
    blended = np.einsum("vj,jab->vab", arrays["weights"], world[:, :3, :3])
    skin = np.einsum("vab,vb->va", blended, posed) + arrays["weights"] @ moved
    return skin + translation, world[:, :3, 3] + translation, joints[0]


def test_posed_mesh_is_that_of_the_formulae(arrays, path):
    rng = np.random.default_rng(1)
    body = smplx.load_smplx(path, "female")
    betas, rotvec, shift = rng.normal(size=10), rng.normal(0, 0.4, (55, 3)), rng.normal(size=3)
    vertices, joints, root = reference(arrays, betas, rotvec, shift)
    order = [FILE_NAMES.index(name) for name in body.joint_names]
    local = rotations(rotvec[order] @ AXES.T)
    hips = (root + shift) @ AXES.T
    turns, places = body.forward_kinematics(hips, local, body.rest_joints(betas))
    np.testing.assert_allclose(places, joints[order] @ AXES.T, atol=1e-6)
    np.testing.assert_allclose(body.skin(betas, turns, places), vertices @ AXES.T, atol=1e-6)


def test_joints_are_ours_and_then_jaw_and_eyes(path):
    body = smplx.load_smplx(path, "female")
    assert body.joint_names == (*skeleton.joint_names(), *smplx.EXTRA_JOINTS)
    assert tuple(body.parents[:52]) == skeleton.parents()
    assert set(body.parents[52:]) == {body.joint_names.index("head")}
    assert body.betas == 10


def test_it_stands_on_the_floor_and_faces_y(path):
    body = smplx.load_smplx(path, "female")
    assert body.rest_vertices(np.zeros(10))[:, 2].min() == pytest.approx(0, abs=1e-9)
    rest = dict(zip(body.joint_names, body.rest_joints(np.zeros(10)), strict=True))
    assert rest["left_foot"][1] > rest["left_ankle"][1]
    assert rest["left_wrist"][0] < 0 < rest["head"][2]


def test_markers_by_geometry_are_near_those_of_anny52(path):
    body, ours = smplx.load_smplx(path, "female"), load_body("anny52", "female", "low")
    found = body.rest_vertices(np.zeros(10), body.marker_vertices)
    known = ours.rest_vertices(np.zeros(10), ours.marker_vertices)
    assert np.linalg.norm(found - known, axis=-1).max() < 0.06
    assert len(body.sole_markers) == 8


def test_markers_of_a_users_file(path, tmp_path):
    table = {name: 3 * k for k, name in enumerate(landmarks.marker_names())}
    chosen = tmp_path / "markers.json"
    chosen.write_text(json.dumps(table))
    body = smplx.load_smplx(path, "female", chosen)
    assert list(body.marker_vertices) == list(table.values())
    chosen.write_text(json.dumps(table | {"C7": 10**6}))
    with pytest.raises(ArtifactError, match="C7: 1000000 is not a vertex"):
        smplx.load_smplx(path, "female", chosen)
    chosen.write_text(json.dumps({"C7": 1}))
    with pytest.raises(ArtifactError, match="the 67 names"):
        smplx.load_smplx(path, "female", chosen)


def test_markers_of_mojos_form_keep_their_names_and_order(path, tmp_path):
    indices = {f"M{k}": 5 * k for k in range(66, -1, -1)}
    chosen = tmp_path / "markers.json"
    chosen.write_text(json.dumps({"markersets": [{"type": "body", "indices": indices}]}))
    body = smplx.load_smplx(path, "female", chosen)
    assert body.marker_names == tuple(indices)
    assert list(body.marker_vertices) == list(indices.values())
    for wrong, message in (({"markersets": []}, "is no object"), ([{}], "has 0 markers")):
        table = wrong if isinstance(wrong, dict) else {"markersets": [{"indices": wrong[0]}]}
        chosen.write_text(json.dumps(table))
        with pytest.raises(ArtifactError, match=message):
            smplx.load_smplx(path, "female", chosen)


def test_the_library_finds_a_users_folder(path, monkeypatch):
    monkeypatch.setenv(SMPLX_FOLDER, str(path.parent))
    assert load_body("smplx", "female").name == "smplx"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"weights": None}, "weights is missing"),
        ({"posedirs": np.zeros((5, 3, 486))}, r"posedirs has shape \(5, 3, 486\)"),
        ({"J_regressor": np.array({"sparse": 1}, dtype=object)}, "pickles may run code"),
        ({"f": np.array("text")}, "not numeric"),
        ({"kintree_table": np.zeros((2, 55), dtype=np.uint32)}, "wrong parents of"),
        ({"shapedirs": np.zeros((1296, 3, 4))}, "has 4 betas, 10 are needed"),
    ],
)
def test_files_of_another_layout_are_refused(tmp_path, arrays, changes, message):
    path = written(tmp_path, arrays, **changes)
    with pytest.raises(ArtifactError, match=message) as caught:
        smplx.load_smplx(path, "female")
    assert "SMPLX_FEMALE.npz" in str(caught.value)


def test_values_that_are_not_finite_are_refused(tmp_path, arrays):
    broken = arrays["v_template"].copy()
    broken[7, 1] = np.nan
    with pytest.raises(ArtifactError, match="v_template has values that are not finite"):
        smplx.load_smplx(written(tmp_path, arrays, v_template=broken), "female")


def test_files_that_are_no_archive(tmp_path):
    text = tmp_path / "SMPLX_MALE.npz"
    text.write_text("hello")
    with pytest.raises(ArtifactError, match="cannot be read as npz"):
        smplx.load_smplx(text, "male")
    np.save(tmp_path / "one.npy", np.zeros(3))
    with pytest.raises(ArtifactError, match="single array"):
        smplx.load_smplx(tmp_path / "one.npy", "male")
