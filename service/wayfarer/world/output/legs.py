"""Legs of a body: what is fixed by its shape, and where joints and soles are in posed frames.

Metres, world, Z up. Left comes before right. Joints are those of the skeleton (SMPL-H order).
"""

from dataclasses import dataclass
from typing import Annotated, Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.body.skeleton import joint_names
from wayfarer.errors import InvalidArgument
from wayfarer.world.output.quaternion import (
    Array,
    length,
    multiply,
    rotate,
    rotate_points,
    stacked,
)
from wayfarer.world.rows import Float, Rows, Shape

SOLES: Final = 4
"""Points under a foot: heel, both balls, toe."""


def _pair(part: str) -> list[int]:
    return [joint_names().index(f"{side}_{part}") for side in ("left", "right")]


HIPS, KNEES, ANKLES, BALLS = (_pair(part) for part in ("hip", "knee", "ankle", "foot"))


@dataclass(slots=True)
class Legs(Rows):
    """Both legs of bodies in the T-pose: each joint seen from the one above it."""

    hip: Annotated[Float, Shape(2, 3)]  # from the root
    knee: Annotated[Float, Shape(2, 3)]
    ankle: Annotated[Float, Shape(2, 3)]
    ball: Annotated[Float, Shape(2, 3)]
    # Points of the sole are skinned to two bones: where each has them, times its share of them.
    sole_of_ankle: Annotated[Float, Shape(2, SOLES, 3)]
    sole_of_ball: Annotated[Float, Shape(2, SOLES, 3)]
    ball_share: Annotated[Float, Shape(2, SOLES)]


def measure_legs(body: BodyModel, betas: NDArray[np.floating[Any]]) -> Legs:
    """One row for a shape [10]. Raises InvalidArgument when a foot has not 4 sole points."""
    if len(body.sole_vertices) != 2 * SOLES:
        raise InvalidArgument(
            f"body {body.name} has {len(body.sole_vertices)} sole points; expected {2 * SOLES}: "
            "heel, two balls and toe of each foot, left ones first"
        )
    vertices = body.sole_vertices.reshape(2, SOLES)
    soles = body.bind_vertices[vertices] + body.bind_vertices_dirs[vertices] @ betas
    joints = body.bind_joints + body.bind_joints_dirs @ betas
    on_ball = body.skin_joints[vertices] == np.array(BALLS)[:, None, None]
    share = (body.skin_weights[vertices] * on_ball).sum(-1)

    def seen_from(bones: list[int], points: Array) -> Array:
        """Points [2, P, 3] of the pose that the body is modelled in, as the T-pose has them."""
        return (points - joints[bones][:, None]) @ body.bind_to_rest[bones].swapaxes(-1, -2)

    row = Legs.empty(1)
    row.hip[0] = seen_from([0, 0], joints[HIPS][:, None])[:, 0]
    row.knee[0] = seen_from(HIPS, joints[KNEES][:, None])[:, 0]
    row.ankle[0] = seen_from(KNEES, joints[ANKLES][:, None])[:, 0]
    row.ball[0] = seen_from(ANKLES, joints[BALLS][:, None])[:, 0]
    row.sole_of_ankle[0] = seen_from(ANKLES, soles) * (1 - share)[..., None]
    row.sole_of_ball[0] = seen_from(BALLS, soles) * share[..., None]
    row.ball_share[0] = share
    return row


@dataclass(frozen=True, slots=True)
class LegPose:
    """Posed legs of A agents in F frames, components first. World turns; places off the root."""

    root_turn: Array  # [4, 1, F, A]
    hip_turn: Array  # [4, 2, F, A]
    knee_turn: Array
    ankle_turn: Array
    hip: Array  # [3, 2, F, A]
    knee: Array
    ankle: Array
    soles: Array  # [3, P, 2, F, A] in the world

    @property
    def facing(self) -> Array:
        """Horizontal unit vectors [2, 1, F, A] that the hips face."""
        x, y, z, w = self.root_turn
        ahead = stacked(-2 * (x * y + z * w), 1 - 2 * (y * y + z * z))
        return ahead / np.maximum(length(ahead), 1e-9)


_USED: Final = (0, *HIPS, *KNEES, *ANKLES, *BALLS)


def pose_legs(legs: Legs, translation: Float, rotations: Float) -> LegPose:
    """Forward kinematics: translation [A, F, 3], rotations [A, F, 22, 4] as in `StepOutputs`."""
    local = np.empty((4, len(_USED), *rotations.shape[1::-1]), rotations.dtype)  # [4, 9, F, A]
    for place, joint in enumerate(_USED):  # all of them at once take five times as long
        local[:, place] = rotations[:, :, joint].transpose(2, 1, 0)
    root_turn = local[:, :1]
    hip = rotate(root_turn, _column(legs.hip))
    hip_turn = multiply(root_turn, local[:, 1:3])
    knee = hip + rotate(hip_turn, _column(legs.knee))
    knee_turn = multiply(hip_turn, local[:, 3:5])
    ankle = knee + rotate(knee_turn, _column(legs.ankle))
    ankle_turn = multiply(knee_turn, local[:, 5:7])
    ball = ankle + rotate(ankle_turn, _column(legs.ball))
    ball_turn = multiply(ankle_turn, local[:, 7:9])

    root = translation.transpose(2, 1, 0)[:, None]
    share = _column(legs.ball_share[..., None])  # [1, P, 2, 1, A]
    soles = (root + ankle)[:, None] + share * (ball - ankle)[:, None]
    soles += rotate_points(ankle_turn, _column(legs.sole_of_ankle))
    soles += rotate_points(ball_turn, _column(legs.sole_of_ball))
    return LegPose(
        root_turn=root_turn,
        hip_turn=hip_turn,
        knee_turn=knee_turn,
        ankle_turn=ankle_turn,
        hip=hip,
        knee=knee,
        ankle=ankle,
        soles=soles,
    )


def _column(values: Float) -> Array:
    """[A, 2, 3] → [3, 2, 1, A], [A, 2, P, 3] → [3, P, 2, 1, A]"""
    return np.ascontiguousarray(values.T)[..., None, :]
