"""The animation is sampled as a glTF player does and compared with the body's joints."""

import numpy as np
import pygltflib

from tests.body.test_glb import read, world_matrices
from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.clips.actor import Actor
from wayfarer.clips.glb import glb_bytes


def test_each_frame_has_the_bodys_joints(tmp_path, clip, body):
    (tmp_path / "c.glb").write_bytes(glb_bytes([Actor(clip, body)]))
    document = pygltflib.GLTF2.load(tmp_path / "c.glb")
    animation = document.animations[0]
    expected = clip.pose(body)[1] @ GLTF_FROM_CORE.T
    for frame in (0, 9, clip.frames - 1):
        moved, turned = {}, {}
        for channel in animation.channels:
            sampler = animation.samplers[channel.sampler]
            into = moved if channel.target.path == "translation" else turned
            into[channel.target.node] = read(document, sampler.output)[frame].astype(float)
        assert list(moved) == [0]  # translation on the hips only
        matrices = world_matrices(document, moved, turned)
        found = np.stack([matrices[node][:3, 3] for node in document.skins[0].joints])
        np.testing.assert_allclose(found, expected[frame], atol=1e-5)


def test_keys_are_at_the_frames_and_neighbours_do_not_flip(tmp_path, clip, body):
    (tmp_path / "c.glb").write_bytes(glb_bytes([Actor(clip, body)]))
    document = pygltflib.GLTF2.load(tmp_path / "c.glb")
    for sampler in document.animations[0].samplers:
        times = read(document, sampler.input)[:, 0]
        np.testing.assert_allclose(times, np.arange(clip.frames) / clip.fps, atol=1e-6)
        values = read(document, sampler.output)
        assert len(values) == clip.frames
        if values.shape[1] == 4:
            assert (np.einsum("nk,nk->n", values[1:], values[:-1]) > 0).all()
