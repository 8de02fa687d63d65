"""Clips as animated GLB: the skinned body with one animation, for engines and Blender."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib as gltf

from wayfarer.body.glb import GlbFile, add_body
from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import GLTF_FROM_CORE, continuous_quaternions, gltf_quaternion
from wayfarer.clips.clip import Clip
from wayfarer.errors import DataError
from wayfarer.spec import POSED_JOINTS


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


def read_glb(path: Path) -> Clip:
    """Read a clip that `write_glb` wrote; GLB has no place for contacts and goals.

    Raises DataError for any other file: joints and body of a foreign GLB are not ours.
    """
    try:
        document = gltf.GLTF2.load_binary(path)
        about, animation = document.extras, document.animations[0]
        values = {
            (channel.target.path, channel.target.node): _floats(
                document, animation.samplers[channel.sampler].output
            )
            for channel in animation.channels
        }
        times = _floats(document, animation.samplers[0].input)[:, 0]
        turns = np.stack([values["rotation", joint] for joint in range(POSED_JOINTS)], axis=1)
        return Clip(
            translation=values["translation", 0] @ GLTF_FROM_CORE,
            rotations=gltf_quaternion(turns),
            contacts=np.zeros((len(times), 2), bool),
            gender=about["gender"],
            betas=tuple(about["betas"]),
            body=about["body"],
            fps=round((len(times) - 1) / float(times[-1] - times[0]), 3),
        )
    except (
        OSError,
        ValueError,
        KeyError,
        IndexError,
        TypeError,
        ZeroDivisionError,
        struct.error,
    ) as error:
        raise DataError(f"not a clip that Wayfarer wrote as GLB: {error!r}", str(path)) from error


def _floats(document: gltf.GLTF2, accessor: int) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Values of a float accessor as `GlbFile.add` packs them. [n, components]."""
    about = document.accessors[accessor]
    view = document.bufferViews[about.bufferView]
    count = about.count * {gltf.SCALAR: 1, gltf.VEC3: 3, gltf.VEC4: 4}[about.type]
    blob = document.binary_blob()
    return np.frombuffer(blob, np.float32, count, view.byteOffset).reshape(about.count, -1)
