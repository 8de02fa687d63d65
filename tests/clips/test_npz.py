import numpy as np
import pytest

from wayfarer.body.rotation import matrix_from_quaternion, quaternion_from_rotvec
from wayfarer.clips.actor import Actor
from wayfarer.clips.npz import npz_bytes, read_npz
from wayfarer.errors import DataError


def test_round_trip(tmp_path, clip, body):
    (tmp_path / "c.npz").write_bytes(npz_bytes(Actor(clip, body)))
    back = read_npz(tmp_path / "c.npz")
    np.testing.assert_allclose(back.translation, clip.translation, atol=1e-9)
    np.testing.assert_allclose(
        matrix_from_quaternion(back.rotations), matrix_from_quaternion(clip.rotations), atol=1e-9
    )
    assert (back.contacts == clip.contacts).all()
    assert (back.gender, back.betas, back.body) == (clip.gender, clip.betas, clip.body)
    assert (back.fps, back.goals) == (clip.fps, clip.goals)


def test_a_reader_of_amass_sees_the_same_joints(tmp_path, clip, body):
    """Joints by SMPL's own rule, from the keys of AMASS and a Y-up rest pose only."""
    (tmp_path / "c.npz").write_bytes(npz_bytes(Actor(clip, body)))
    data = np.load(tmp_path / "c.npz")
    assert data["poses"].shape == (clip.frames, 156)
    assert not data["poses"][:, 66:].any()
    rest = body.rest_joints(data["betas"])
    rest = np.stack([-rest[:, 0], rest[:, 2], rest[:, 1]], -1)  # Y up, facing +Z
    turns = matrix_from_quaternion(quaternion_from_rotvec(data["poses"].reshape(-1, 52, 3)))
    world, places = [turns[:, 0]], [rest[0] + data["trans"]]
    for joint, parent in enumerate(body.parents[1:], start=1):
        places.append(places[parent] + world[parent] @ (rest[joint] - rest[parent]))
        world.append(world[parent] @ turns[:, joint])
    np.testing.assert_allclose(np.stack(places, 1), clip.pose(body)[1], atol=1e-6)


def test_a_file_of_amass_itself_is_read(tmp_path, body):
    np.savez(
        tmp_path / "amass.npz",
        poses=np.zeros((4, 156)),
        trans=np.zeros((4, 3)),
        betas=np.zeros(16),
        gender="neutral",
        mocap_framerate=120.0,
        dmpls=np.zeros((4, 8)),
    )
    clip = read_npz(tmp_path / "amass.npz")
    assert (clip.fps, clip.frames, clip.body) == (120.0, 4, "anny52")
    assert not clip.contacts.any()
    # the unturned SMPL body lies on its back in the Z-up world: its head is towards +Y
    rotations, _ = clip.pose(body)
    np.testing.assert_allclose(rotations[0, 0] @ [0, 0, 1], [0, 1, 0], atol=1e-9)


def test_malformed_files_are_named(tmp_path):
    text = tmp_path / "text.npz"
    text.write_text("not a zip")
    with pytest.raises(DataError, match=r"text\.npz: not a readable npz"):
        read_npz(text)
    np.savez(tmp_path / "keys.npz", poses=np.zeros((2, 156)))
    with pytest.raises(DataError, match=r"keys \['mocap_framerate', 'trans'\] are missing"):
        read_npz(tmp_path / "keys.npz")
    np.savez(
        tmp_path / "shape.npz", poses=np.zeros((2, 30)), trans=np.zeros((2, 3)), mocap_framerate=40
    )
    with pytest.raises(DataError, match=r"poses \(2, 30\)"):
        read_npz(tmp_path / "shape.npz")
