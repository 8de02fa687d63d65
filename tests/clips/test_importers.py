"""Files as the importers of others see them: three.js, Babylon.js, three-vrm-animation."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.programs import run_program
from wayfarer.body.library import load_body
from wayfarer.body.rotation import GLTF_FROM_CORE, gltf_quaternion
from wayfarer.body.skeleton import bone_names
from wayfarer.clips.files import (
    BodyDetail,
    FileFormat,
    FileOptions,
    Performance,
    RootMotion,
    encode,
)

HERE = Path(__file__).parent / "importers"
PACKAGES = Path(__file__).parents[1] / "node_modules"


def needs(*packages: str):
    there = shutil.which("node") and all((PACKAGES / name).is_dir() for name in packages)
    return pytest.mark.skipif(not there, reason=f"needs node and {packages}: make test")


def run(script: str, *arguments: object):
    return json.loads(run_program("node", HERE / script, *arguments).stdout)


@pytest.mark.parametrize("root", [RootMotion.HIPS, RootMotion.BONE])
@pytest.mark.parametrize(
    "script",
    [
        pytest.param("three.mjs", marks=needs("three")),
        pytest.param("babylon.mjs", marks=needs("@babylonjs/core", "@babylonjs/loaders")),
    ],
)
def test_bones_are_where_the_bodies_have_them(tmp_path, clip, script, root):
    """Two people, one with another gender and start; within 1 mm."""
    other = replace(clip, gender="male", translation=clip.translation + np.array([2, 1, 0]))
    people = [Performance("Ada", clip), Performance("Bob", other, style=4)]
    options = FileOptions(root=root, detail=BodyDetail.LOW)
    (tmp_path / "two.glb").write_bytes(encode(people, options, "walk"))
    frames = [0, 7, clip.frames - 1]
    found = run(script, tmp_path / "two.glb", [frame / clip.fps for frame in frames])
    assert found["duration"] == pytest.approx((clip.frames - 1) / clip.fps, abs=1e-4)
    for frame, places in zip(frames, found["frames"], strict=True):
        assert len(places) == 2
        for person, bones in zip(people, places, strict=True):
            body = load_body("anny52", person.clip.gender, "low")
            wanted = person.clip.pose(body)[1][frame] @ GLTF_FROM_CORE.T
            at = {name.split("_")[0]: place for name, *place in bones}  # "Hips_1": the second's
            assert len(at) == 52 + (root is RootMotion.BONE)
            for name, place in zip(bone_names("mixamo"), wanted, strict=True):
                np.testing.assert_allclose(at[name], place, atol=1e-3, err_msg=name)


@needs("three", "@pixiv/three-vrm-animation")
def test_vrm_animation(tmp_path, clip, body):
    options = FileOptions(FileFormat.VRMA)
    (tmp_path / "a.vrma").write_bytes(encode([Performance("Ada", clip)], options))
    frame = 9
    found = run("vrma.mjs", tmp_path / "a.vrma", frame / clip.fps)
    assert found["duration"] == pytest.approx((clip.frames - 1) / clip.fps, abs=1e-4)
    rest = body.rest_joints(np.asarray(clip.betas))[0] @ GLTF_FROM_CORE.T
    np.testing.assert_allclose(found["hips"], rest, atol=1e-4)
    place = clip.translation[frame] @ GLTF_FROM_CORE.T
    assert list(found["translation"]) == ["hips"]
    np.testing.assert_allclose(found["translation"]["hips"], place, atol=1e-4)
    wanted = dict(zip(bone_names("vrm"), gltf_quaternion(clip.rotations[frame]), strict=False))
    assert set(found["rotation"]) == set(wanted)
    for bone, turn in wanted.items():
        assert abs(np.dot(found["rotation"][bone], turn)) == pytest.approx(1, abs=1e-5), bone
