import numpy as np
import pytest

from tests.clips.test_bvh import parse_text, places
from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.body.skeleton import bone_names
from wayfarer.clips.files import (
    BodyDetail,
    FileFormat,
    FileOptions,
    FileUnit,
    Performance,
    RootMotion,
    encode,
    read_clip,
    write_clip,
)
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


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"format": FileFormat.VRMA, "root": RootMotion.BONE}, "vrma has no bone above the hips"),
        ({"unit": FileUnit.CENTIMETRES}, "the unit of glb is the metre"),
        ({"fps": 0.0}, "fps is 0; allowed are 1 to 240"),
    ],
)
def test_options_that_contradict_each_other_are_refused(options, message):
    with pytest.raises(InvalidArgument, match=message):
        FileOptions(**options)


@pytest.mark.parametrize("format", [FileFormat.BVH, FileFormat.NPZ, FileFormat.VRMA])
def test_several_people_are_refused_where_one_fits(clip, format):
    with pytest.raises(InvalidArgument, match="holds one person, not 2; glb and usd hold several"):
        encode([Performance("a", clip)] * 2, FileOptions(format))
    with pytest.raises(InvalidArgument, match="nobody"):
        encode([], FileOptions(format))


def test_a_path_on_a_bone_is_read_again(tmp_path, clip):
    write_clip(tmp_path / "a.glb", clip, FileOptions(root=RootMotion.BONE, detail=BodyDetail.LOW))
    np.testing.assert_allclose(
        read_clip(tmp_path / "a.glb").translation, clip.translation, atol=1e-5
    )


def test_bvh_in_centimetres_at_another_rate_with_a_root(clip, body):
    options = FileOptions(FileFormat.BVH, root=RootMotion.BONE, unit=FileUnit.CENTIMETRES, fps=120)
    text = encode([Performance("a", clip)], options).decode()
    joints, frames, frame_time = parse_text(text)
    assert frame_time == pytest.approx(1 / 120) and joints[0][0] == "root"
    wanted = clip.pose(body)[1] @ GLTF_FROM_CORE.T
    for frame in (0, 7, clip.frames - 1):
        found = places(joints, frames[3 * frame])
        for name, place in zip(bone_names("mixamo")[:22], wanted[frame], strict=False):
            np.testing.assert_allclose(found[name], 100 * place, atol=0.1, err_msg=name)


def test_usd_without_its_package_says_what_to_install(monkeypatch):
    monkeypatch.setattr("wayfarer.clips.usd.find_spec", lambda name: None)
    with pytest.raises(InvalidArgument, match="pip install usd-core"):
        FileOptions(FileFormat.USD)
