"""Clips as BVH, the plain-text motion format that every animation tool reads.

Written in the glTF basis (Y up, the T-pose faces +Z) in metres. The unit is not part of the format;
tools that expect centimetres want `scale=100`. Rotation channels are Z, X, Y in degrees: local =
Rz · Rx · Ry. The 22 posed joints are written; fingers are at rest and left out. A separate root
joint, if there is one, is above the hips.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.rotation import GLTF_FROM_CORE, gltf_quaternion, matrix_from_quaternion
from wayfarer.body.skeleton import bone_names
from wayfarer.clips.actor import Actor
from wayfarer.clips.glb import ROOT
from wayfarer.spec import POSED_JOINTS

Array = NDArray[np.floating[Any]]


def bvh_text(actor: Actor, names: str = "mixamo", scale: float = 1.0) -> str:
    """The motion of one person; `names`: vocabulary of the joints; `scale`: units per metre."""
    clip, body, root = actor.clip, actor.body, actor.root
    words = bone_names(names)
    rest = body.rest_joints(np.asarray(clip.betas)) @ GLTF_FROM_CORE.T * scale
    children: list[list[int]] = [[] for _ in body.parents]
    for joint, parent in enumerate(body.parents[1:], start=1):
        children[parent].append(joint)
    lines = ["HIERARCHY"]
    order: list[int] = []

    def offset_line(values: Array, depth: int) -> str:
        return "\t" * depth + "OFFSET " + " ".join(f"{value:.6f}" for value in values)

    def write_joint(joint: int, depth: int) -> None:
        order.append(joint)
        tab = "\t" * depth
        lines.append(f"{tab}{'JOINT' if depth else 'ROOT'} {words[joint]}")
        lines.append(tab + "{")
        # the hips' place is in the channels; some readers add the root's offset to it, some do not
        offset = rest[joint] - rest[body.parents[joint]] if joint else np.zeros(3)
        lines.append(offset_line(offset, depth + 1))
        rotations = "Zrotation Xrotation Yrotation"
        moves = "CHANNELS 3 " if joint else "CHANNELS 6 Xposition Yposition Zposition "
        lines.append(f"{tab}\t{moves}{rotations}")
        posed = [child for child in children[joint] if child < POSED_JOINTS]
        for child in posed:
            write_joint(child, depth + 1)
        if not posed:
            end = _end_offset(rest, children[joint], joint, body.parents[joint])
            lines.extend(
                [f"{tab}\tEnd Site", tab + "\t{", offset_line(end, depth + 2), tab + "\t}"]
            )
        lines.append(tab + "}")

    def channels(places: Array, turns: Array) -> list[Array]:
        matrices = matrix_from_quaternion(gltf_quaternion(np.asarray(turns, np.float64)))
        angles = np.degrees(zxy_angles(matrices)).reshape(clip.frames, -1)
        return [places @ GLTF_FROM_CORE.T * scale, angles]

    if root is None:
        write_joint(0, 0)
        columns = []
    else:
        lines += [f"ROOT {ROOT}", "{", offset_line(np.zeros(3), 1)]
        lines.append("\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation")
        write_joint(0, 1)
        lines.append("}")
        columns = channels(root.places, root.turns)
    columns += channels(np.asarray(clip.translation), np.asarray(clip.rotations)[:, order])
    lines += ["MOTION", f"Frames: {clip.frames}", f"Frame Time: {1 / clip.fps:.8f}"]
    lines += [" ".join(f"{v:.6f}" for v in row) for row in np.concatenate(columns, -1)]
    return "\n".join(lines) + "\n"


def zxy_angles(matrix: Array) -> Array:
    """Radians (z, x, y) with matrix = Rz · Rx · Ry. [..., 3, 3] → [..., 3].

    At x = ±90° (gimbal lock) only z ± y is known; y is set to 0 there.
    """
    sine = np.clip(matrix[..., 2, 1], -1.0, 1.0)
    locked = np.abs(sine) > 1 - 1e-9
    z = np.where(
        locked,
        np.arctan2(matrix[..., 1, 0], matrix[..., 0, 0]),
        np.arctan2(-matrix[..., 0, 1], matrix[..., 1, 1]),
    )
    y = np.where(locked, 0.0, np.arctan2(-matrix[..., 2, 0], matrix[..., 2, 2]))
    return np.stack([z, np.arcsin(sine), y], -1)


def _end_offset(rest: Array, children: list[int], joint: int, parent: int) -> Array:
    """The end of the last bone: the middle of its rest children, or half its parent's length."""
    if children:
        return rest[children].mean(0) - rest[joint]
    return (rest[joint] - rest[parent]) / 2
