"""From the bind pose (the A-pose in which anny is modelled) to the T-pose, one rotation per bone.

World rotations of bones about their heads, found on the gender's mean body and then fixed, so
that rest places stay linear in betas. Arms lie along the X axis with palms down and elbows that
flex forward. Legs hang straight down with feet pointing ahead. Trunk, neck, head and collars
stay as modelled. Fingers keep the hand's turn (their curl is added when the body is
loaded, see `wayfarer.body.hands`).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.rotation import (
    matrix_from_quaternion,
    quaternion_from_matrix,
    quaternion_from_rotvec,
)

Array = NDArray[np.floating[Any]]

LEFT = np.array([-1.0, 0.0, 0.0])
AHEAD = np.array([0.0, 1.0, 0.0])
DOWN = np.array([0.0, 0.0, -1.0])
MIRROR = np.diag([-1.0, 1.0, 1.0])


def bind_to_rest(names: Sequence[str], bind_joints: Array) -> Array:
    """Rotation of each bone from bind pose to T-pose, [J, 3, 3], of a left-right symmetric body."""
    place = dict(zip(names, bind_joints, strict=True))
    left = _left_arm(place) | _left_leg(place)
    turns = np.tile(np.eye(3), (len(names), 1, 1))
    for j, name in enumerate(names):
        side, _, part = name.partition("_")
        if part[:-1] in ("index", "middle", "pinky", "ring", "thumb"):
            part = "wrist"
        if side in ("left", "right") and part in left:
            turns[j] = left[part] if side == "left" else MIRROR @ left[part] @ MIRROR
    return turns


def _left_arm(place: dict[str, Array]) -> dict[str, Array]:
    shoulder, elbow, wrist = (place[f"left_{n}"] for n in ("shoulder", "elbow", "wrist"))
    knuckles = {n: place[f"left_{n}1"] for n in ("index", "middle", "pinky")}
    upper, fore, hand = elbow - shoulder, wrist - elbow, knuckles["middle"] - wrist
    arm = _frame(LEFT, AHEAD) @ _frame(upper, fore).T  # elbow flexes forward
    palm = _frame(LEFT, AHEAD) @ _frame(hand, knuckles["index"] - knuckles["pinky"]).T
    straight = _shortest(arm @ fore, LEFT) @ arm
    # The palm turns further than the straightened arm: half of that twist is the forearm's.
    twist = _twist_about(palm @ straight.T, LEFT)
    return {"shoulder": arm, "elbow": _turn(LEFT * twist / 2) @ straight, "wrist": palm}


def _left_leg(place: dict[str, Array]) -> dict[str, Array]:
    hip, knee, ankle, ball = (place[f"left_{n}"] for n in ("hip", "knee", "ankle", "foot"))
    foot = (ball - ankle) * [1, 1, 0]  # turned about Z only: the sole is flat as modelled
    ahead = _shortest(foot, AHEAD)
    return {
        "hip": _shortest(knee - hip, DOWN),
        "knee": _shortest(ankle - knee, DOWN),
        "ankle": ahead,
        "foot": ahead,
    }


def _frame(along: Array, towards: Array) -> Array:
    """Orthonormal frame, columns: along, the part of `towards` square to it, their cross."""
    first = along / np.linalg.norm(along)
    second = towards - (towards @ first) * first
    second = second / np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)], -1)


def _turn(rotvec: Array) -> Array:
    return matrix_from_quaternion(quaternion_from_rotvec(rotvec))


def _shortest(source: Array, target: Array) -> Array:
    """The smallest rotation that turns one direction into another (not opposite) one."""
    a, b = source / np.linalg.norm(source), target / np.linalg.norm(target)
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis)
    if sine < 1e-12:
        return np.eye(3)
    return _turn(axis / sine * np.arctan2(sine, a @ b))


def _twist_about(rotation: Array, axis: Array) -> float:
    """Angle of the swing-twist decomposition's twist about a unit axis, radians."""
    quaternion = quaternion_from_matrix(rotation)
    return float(2 * np.arctan2(quaternion[:3] @ axis, quaternion[3]))
