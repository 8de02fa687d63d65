import numpy as np
import pytest

from wayfarer.clips.files import read_clip, write_clip
from wayfarer.errors import DataError, InvalidArgument, NotFound


@pytest.mark.parametrize("name", ["a.npz", "a.glb", "a.GLB"])
def test_what_is_written_is_read_again(tmp_path, clip, name):
    write_clip(tmp_path / name, clip)
    found = read_clip(tmp_path / name)
    np.testing.assert_allclose(found.translation, clip.translation, atol=1e-6)
    same = np.abs((found.rotations * clip.rotations).sum(-1))  # q and -q are one rotation
    np.testing.assert_allclose(same, 1, atol=1e-6)
    assert (found.gender, found.body, found.fps) == (clip.gender, clip.body, clip.fps)
    np.testing.assert_allclose(found.betas, clip.betas, atol=1e-6)


@pytest.mark.parametrize("name", ["a.bvh", "a.png", "a"])
def test_other_names_are_refused(tmp_path, name):
    with pytest.raises(InvalidArgument, match=r"ends in \.glb, \.npz"):
        read_clip(tmp_path / name)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(NotFound, match=r"a\.npz: there is no such file"):
        read_clip(tmp_path / "a.npz")


@pytest.mark.parametrize("content", [b"", b"glTF", b"PK\x03\x04", b"no file of ours" * 9])
@pytest.mark.parametrize("name", ["a.glb", "a.npz"])
def test_what_is_no_clip_is_refused(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=name):
        read_clip(tmp_path / name)


def test_a_body_without_motion_is_no_clip(tmp_path, body):
    from wayfarer.body.glb import body_glb

    (tmp_path / "a.glb").write_bytes(body_glb(body, np.zeros(10)))
    with pytest.raises(DataError, match="not a clip that Wayfarer wrote"):
        read_clip(tmp_path / "a.glb")
