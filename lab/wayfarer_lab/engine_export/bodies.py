"""Bodies and start poses as numbers that a host needs beside the graph: `body_<gender>.bin`.

Everything is linear in the shape: a value for `betas` is its mean plus `dirs` times betas. So a
host places any person in any start pose without skinning a mesh.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.spec import POSED_JOINTS
from wayfarer.world.output.legs import measure_legs

Array = NDArray[Any]


@dataclass(frozen=True)
class BodyTensor:
    """A tensor of the file."""

    name: str
    values: Array
    unit: str
    meaning: str


def body_parts(body: BodyModel, start_poses: Array) -> list[BodyTensor]:
    """Contents of the file of one body; start_poses [P, 22, 4]."""
    zero, unit = np.zeros(body.betas), np.eye(body.betas)
    bones, bones_dirs = _linear(lambda betas: _offsets(body, betas), zero, unit)
    parts = [
        BodyTensor(
            "start_rotations",
            start_poses,
            "quaternion x, y, z, w",
            "rotations of the joints in each start pose, at heading 0",
        )
    ]
    posed = [
        _linear(lambda betas, pose=pose: _markers(body, pose, betas), zero, unit)
        for pose in start_poses.astype(np.float64)
    ]
    places = "in each start pose with the hips at the origin, at heading 0"
    change = "m per unit of beta", "its change with each beta"
    parts += [
        BodyTensor("start_markers", np.stack([m for m, _ in posed]), "m", f"markers {places}"),
        BodyTensor("start_markers_dirs", np.stack([d for _, d in posed]), *change),
        BodyTensor(
            "bones",
            bones,
            "m",
            "place of each joint seen from its parent, in the T-pose; of the hips, over the floor",
        ),
        BodyTensor("bones_dirs", bones_dirs, *change),
    ]
    meanings = {
        "sole_of_ankle": "sole markers as the ankle has them, times its share of them, T-pose",
        "sole_of_ball": "sole markers as the ball of the foot has them, times its share, T-pose",
    }
    for name, meaning in meanings.items():

        def measured(betas: Array, name: str = name) -> Array:
            return np.asarray(getattr(measure_legs(body, betas), name)[0], np.float64)

        mean, dirs = _linear(measured, zero, unit)
        parts.append(BodyTensor(name, mean, "m", meaning))
        parts.append(BodyTensor(f"{name}_dirs", dirs, *change))
    share = measure_legs(body, zero).ball_share[0]
    parts.append(
        BodyTensor("ball_share", share, "1", "share that the ball has of each sole marker")
    )
    return [BodyTensor(p.name, p.values.astype("<f4"), p.unit, p.meaning) for p in parts]


def _linear(measure: Any, zero: Array, unit: Array) -> tuple[Array, Array]:
    """The mean of what is linear in betas, and its change with each of them on a last axis."""
    mean = measure(zero)
    return mean, np.stack([measure(one) - mean for one in unit], -1)


def _offsets(body: BodyModel, betas: Array) -> Array:
    """[22, 3]"""
    joints = body.rest_joints(betas)[:POSED_JOINTS]
    offsets = joints.copy()
    offsets[1:] -= joints[body.parents[1:POSED_JOINTS]]
    return offsets


def _markers(body: BodyModel, pose: Array, betas: Array) -> Array:
    """[67, 3]"""
    turns, places = body.forward_kinematics(
        np.zeros(3), matrix_from_quaternion(pose), body.rest_joints(betas)
    )
    return body.markers(betas, turns, places)
