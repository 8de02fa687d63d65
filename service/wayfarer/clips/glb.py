"""Clips as animated GLB: the skinned body with one animation, for engines and Blender."""

from pathlib import Path

import numpy as np
import pygltflib as gltf

from wayfarer.body.glb import GlbFile, add_body
from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import GLTF_FROM_CORE, continuous_quaternions, gltf_quaternion
from wayfarer.clips.clip import Clip


def write_glb(path: Path, clip: Clip, body: BodyModel, style: int = 0) -> None:
    """Write body, skin and motion; glTF basis, linear interpolation, key at each frame."""
    file = GlbFile()
    joints = add_body(file, body, np.asarray(clip.betas), style)
    translation = (clip.translation @ GLTF_FROM_CORE.T).astype(np.float32)
    # neighbours on one half-sphere: a player that does not flip signs itself would spin
    rotations = continuous_quaternions(gltf_quaternion(clip.rotations)).astype(np.float32)
    times = file.add((np.arange(clip.frames) / clip.fps).astype(np.float32))
    animation = gltf.Animation(name="motion")

    def add_channel(values: np.ndarray, node: int, channel: str) -> None:
        animation.samplers.append(gltf.AnimationSampler(input=times, output=file.add(values)))
        target = gltf.AnimationChannelTarget(node=node, path=channel)
        animation.channels.append(
            gltf.AnimationChannel(sampler=len(animation.samplers) - 1, target=target)
        )

    add_channel(translation, joints[0], "translation")
    for joint in range(rotations.shape[1]):
        add_channel(np.ascontiguousarray(rotations[:, joint]), joints[joint], "rotation")
    file.document.animations.append(animation)
    path.write_bytes(file.to_bytes())
