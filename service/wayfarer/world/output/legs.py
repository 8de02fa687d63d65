"""Legs of bodies: properties of their shapes, and joints and soles in posed frames.

Metres, world, Z up. Left comes before right. Joints are those of the skeleton (SMPL-H order).
"""

from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.body.skeleton import joint_names
from wayfarer.errors import InvalidArgument
from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.spec import POSED_JOINTS
from wayfarer.world.output.quaternion import Array
from wayfarer.world.output.turns import (
    Turn,
    Vector,
    add,
    multiply,
    put,
    put_vector,
    rotate,
    turn,
    vector,
)
from wayfarer.world.rows import Float, Rows, Shape

SOLES: Final = 4
"""Points under a foot: heel, both balls, toe."""


def _pair(part: str) -> tuple[int, int]:
    left, right = (joint_names().index(f"{side}_{part}") for side in ("left", "right"))
    return left, right


HIPS, KNEES, ANKLES, BALLS = (_pair(part) for part in ("hip", "knee", "ankle", "foot"))


@dataclass(slots=True)
class Legs(Rows):
    """Both legs of bodies in the T-pose: each joint relative to the one above it."""

    hip: Annotated[Float, Shape(2, 3)]  # from the root
    knee: Annotated[Float, Shape(2, 3)]
    ankle: Annotated[Float, Shape(2, 3)]
    ball: Annotated[Float, Shape(2, 3)]
    # Points of the sole are skinned to two bones: their offset from each, times its share of them.
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

    def seen_from(joint: list[int] | tuple[int, int], points: Array) -> Array:
        """Converts points [2, P, 3] from the pose in which the body is modelled to the T-pose."""
        return (points - joints[list(joint)][:, None]) @ body.bind_to_rest[list(joint)].swapaxes(
            -1, -2
        )

    row = Legs.empty(1)
    row.hip[0] = seen_from([0, 0], joints[list(HIPS)][:, None])[:, 0]
    row.knee[0] = seen_from(HIPS, joints[list(KNEES)][:, None])[:, 0]
    row.ankle[0] = seen_from(KNEES, joints[list(ANKLES)][:, None])[:, 0]
    row.ball[0] = seen_from(ANKLES, joints[list(BALLS)][:, None])[:, 0]
    row.sole_of_ankle[0] = seen_from(ANKLES, soles) * (1 - share)[..., None]
    row.sole_of_ball[0] = seen_from(BALLS, soles) * share[..., None]
    row.ball_share[0] = share
    return row


class LegPose(NamedTuple):
    """Posed legs of A agents in F frames. Rotations in the world; places relative to the root."""

    root_turn: Float  # [A, F, 4]
    hip_turn: Float  # [A, F, 2, 4]
    knee_turn: Float
    ankle_turn: Float
    hip: Float  # [A, F, 2, 3]
    knee: Float
    ankle: Float
    soles: Float  # [A, F, 2, P, 3] in the world


class Leg(NamedTuple):
    """One posed leg in one frame. Rotations in the world; places relative to the root."""

    root_turn: Turn
    hip_turn: Turn
    knee_turn: Turn
    ankle_turn: Turn
    ball_turn: Turn
    hip: Vector
    knee: Vector
    ankle: Vector
    ball: Vector


class Bones(NamedTuple):
    """The columns of `Legs`, for compiled rules."""

    hip: Float
    knee: Float
    ankle: Float
    ball: Float
    sole_of_ankle: Float
    sole_of_ball: Float
    ball_share: Float


def packed(values: Array) -> Float:
    """The same numbers in the form that compiled rules take; others would be compiled again."""
    return np.ascontiguousarray(values, np.float32)


def bones(legs: Legs) -> Bones:
    """The same columns."""
    return Bones(*(getattr(legs, name) for name in Bones._fields))


@inner
def pose_leg(legs: Bones, row: int, frame: int, foot: int, rotations: Float) -> Leg:
    """Forward kinematics of a row's foot in a frame, from rotations [A, F, 22, 4]."""
    of = row, foot
    root_turn = turn(rotations, (row, frame, 0))
    hip = rotate(root_turn, vector(legs.hip, of))
    hip_turn = multiply(root_turn, turn(rotations, (row, frame, HIPS[foot])))
    knee = add(hip, rotate(hip_turn, vector(legs.knee, of)))
    knee_turn = multiply(hip_turn, turn(rotations, (row, frame, KNEES[foot])))
    ankle = add(knee, rotate(knee_turn, vector(legs.ankle, of)))
    ankle_turn = multiply(knee_turn, turn(rotations, (row, frame, ANKLES[foot])))
    ball = add(ankle, rotate(ankle_turn, vector(legs.ball, of)))
    ball_turn = multiply(ankle_turn, turn(rotations, (row, frame, BALLS[foot])))
    return Leg(root_turn, hip_turn, knee_turn, ankle_turn, ball_turn, hip, knee, ankle, ball)


@inner
def sole_point(legs: Bones, row: int, foot: int, point: int, leg: Leg, root: Vector) -> Vector:
    """Place of a sole's point in the world."""
    of = row, foot, point
    share = float(legs.ball_share[of])
    by_ankle = rotate(leg.ankle_turn, vector(legs.sole_of_ankle, of))
    by_ball = rotate(leg.ball_turn, vector(legs.sole_of_ball, of))
    return (
        root[0] + leg.ankle[0] + share * (leg.ball[0] - leg.ankle[0]) + by_ankle[0] + by_ball[0],
        root[1] + leg.ankle[1] + share * (leg.ball[1] - leg.ankle[1]) + by_ankle[1] + by_ball[1],
        root[2] + leg.ankle[2] + share * (leg.ball[2] - leg.ankle[2]) + by_ankle[2] + by_ball[2],
    )


def pose_legs(legs: Legs, translation: Float, rotations: Float) -> LegPose:
    """Forward kinematics: translation [A, F, 3], rotations [A, F, 22, 4] as in `StepOutputs`."""
    pose = _room_for(packed(rotations[:, :, 0]))
    _pose(bones(legs), packed(translation), packed(rotations), pose)
    return pose


def _room_for(root_turn: Float) -> LegPose:
    shape = (*root_turn.shape[:2], 2)
    return LegPose(
        root_turn=root_turn,
        hip_turn=np.empty((*shape, 4), np.float32),
        knee_turn=np.empty((*shape, 4), np.float32),
        ankle_turn=np.empty((*shape, 4), np.float32),
        hip=np.empty((*shape, 3), np.float32),
        knee=np.empty((*shape, 3), np.float32),
        ankle=np.empty((*shape, 3), np.float32),
        soles=np.empty((*shape, SOLES, 3), np.float32),
    )


@cache
def prepare() -> None:
    """Compiles the kinematics, or loads them, before agents walk."""
    turns = np.ones((1, 1, POSED_JOINTS, 4), np.float32)
    hips = np.zeros((1, 1, 3), np.float32)
    warm(_pose, bones(Legs.empty(1)), hips, turns, _room_for(packed(turns[:, :, 0])))


@compiled
def _pose(legs: Bones, translation: Float, rotations: Float, pose: LegPose) -> None:
    for row in range(len(rotations)):
        for frame in range(rotations.shape[1]):
            root = vector(translation, (row, frame))
            for foot in range(2):
                leg, at = pose_leg(legs, row, frame, foot, rotations), (row, frame, foot)
                put(pose.hip_turn, at, leg.hip_turn)
                put(pose.knee_turn, at, leg.knee_turn)
                put(pose.ankle_turn, at, leg.ankle_turn)
                put_vector(pose.hip, at, leg.hip)
                put_vector(pose.knee, at, leg.knee)
                put_vector(pose.ankle, at, leg.ankle)
                for point in range(SOLES):
                    sole = sole_point(legs, row, foot, point, leg, root)
                    put_vector(pose.soles, (row, frame, foot, point), sole)
