"""The animation as a glTF player shows it, compared with the body's joints."""

import numpy as np

from tests.played import Played, parts
from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.clips.actor import Actor
from wayfarer.clips.glb import glb_bytes


def test_each_frame_has_the_bodys_joints(clip, body):
    played = Played(*parts(glb_bytes([Actor(clip, body)])))
    assert [node for node, path in played.channels if path == "translation"] == [0]  # the hips
    found = played.places(played.document["skins"][0]["joints"])
    np.testing.assert_allclose(found, clip.pose(body)[1] @ GLTF_FROM_CORE.T, atol=1e-5)


def test_keys_are_at_the_frames_and_neighbours_do_not_flip(clip, body):
    played = Played(*parts(glb_bytes([Actor(clip, body)])))
    for sampler in played.document["animations"][0]["samplers"]:
        times = played.values(sampler["input"])[:, 0]
        np.testing.assert_allclose(times, np.arange(clip.frames) / clip.fps, atol=1e-6)
    for (_, path), values in played.channels.items():
        assert len(values) == clip.frames
        if path == "rotation":
            assert (np.einsum("nk,nk->n", values[1:], values[:-1]) > 0).all()
