"""How the people of a file stand: which way is up, and which pose counts as their rest pose.

A zero pose is a rest pose when it stands upright along one of its axes. Otherwise, a
frame of the motion in which the person stands takes its place (a `RestFrame`).
Joints are our 22, in the axes and unit of the file.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.joints import joint_map
from wayfarer_lab.training.mocap.rig import J
from wayfarer_lab.training.mocap.skeleton import Array, MocapSkeleton

UP = {"y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}
"""Upward axes that the world of a file may have."""
Z_UP = {"y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), "z": np.eye(3)}
"""Rotation from the world of a file to Z up, by upward axis."""
UPRIGHT = 0.7
"""Least cosine between the vertical and a limb or trunk of a pose that stands."""
ERECT = 0.8
"""Least cosine between the vertical and the line from feet to head of a person on their feet."""
STILL = 0.25
"""Leg lengths a second that no joint of a standing frame may exceed."""
_LEGS = [[J[f"{side}_{part}"] for part in ("hip", "knee", "ankle")] for side in ("left", "right")]
_FEET = [J["left_foot"], J["right_foot"]]
_ANKLES = [J["left_ankle"], J["right_ankle"]]
_ARMS = [
    [J[f"{side}_{part}"] for part in ("shoulder", "elbow", "wrist")] for side in ("left", "right")
]
_STANDING = np.deg2rad([20.0, 15.0, 15.0, 25.0, 35.0, 35.0, 40.0])
"""Most that a standing frame's legs, trunk, sides, turn of the shoulders, head, upper arms and
elbows may be off, radians."""


@dataclass(frozen=True)
class RestFrame:
    """A frame in which the person stands, in the axes and unit of its file."""

    clip: str
    frame: int  # of the file, from 0
    places: Array  # [22, 3]
    rotations: Array  # [22, 3, 3] world, relative to the file's zero pose

    def __str__(self) -> str:
        return f"frame {self.frame} of {self.clip}"


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def _turns() -> list[tuple[Array, Array]]:
    """Upward axes and the rotations that turn them to +Z; Y first, then Z, then the others."""
    found = [(UP[axis], Z_UP[axis]) for axis in ("y", "z")]
    for up, other in (([1.0, 0, 0], 1), ([0, -1.0, 0], 2), ([0, 0, -1.0], 0), ([-1.0, 0, 0], 1)):
        z = np.array(up)
        x = np.eye(3)[other]
        found.append((z, np.stack([x, np.cross(z, x), z])))
    return found


def rest_turn(rest: Array) -> Array:
    """Rotation [3, 3] from the axes of a rest pose [22, 3] to ours: facing +Y with Z up.

    Raises DataError if the pose does not stand upright, with straight legs below the hips.
    """
    trunk = _unit(rest[J["neck"]] - rest[J["pelvis"]])
    bones = [_unit(rest[b] - rest[a]) for leg in _LEGS for a, b in itertools.pairwise(leg)]
    standing = (
        turn
        for up, turn in _turns()
        if trunk @ up > UPRIGHT and all(bone @ up < -UPRIGHT for bone in bones)
    )
    to_z = next(standing, None)
    if to_z is None:
        raise DataError(
            "the zero pose does not stand upright (T- or A-pose) with its legs below the hips"
        )
    right = to_z @ (rest[J["right_hip"]] - rest[J["left_hip"]])
    angle = -np.arctan2(right[1], right[0])
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ to_z


def stands(rest: Array) -> bool:
    """Whether a pose [22, 3] can be a rest pose."""
    try:
        rest_turn(rest)
    except DataError:
        return False
    return True


def rest_axis(skeleton: MocapSkeleton) -> str:
    """The axis, y or z, along which a zero pose stands; y if it stands along neither."""
    rest = skeleton.rest_places()[joint_map(skeleton)]
    return "z" if stands(rest) and rest_turn(rest)[2, 2] > UPRIGHT else "y"


def upward_axis(places: Array, usual: str) -> str:
    """The axis of the world, y or z, along which people stand in a motion [N, 22, 3].

    It is `usual` unless nobody ever stands along that one and almost everybody along the other.
    """
    line = _unit(places[:, J["head"]] - places[:, _ANKLES].mean(1))
    share = {axis: float((line @ up > ERECT).mean()) for axis, up in UP.items()}
    other = "z" if usual == "y" else "y"
    return other if share[usual] < 0.05 and share[other] > 0.9 else usual


def standing_frame(places: Array, axis: str, fps: float) -> tuple[int, float] | None:
    """The frame of a motion [N, 22, 3] in which the person stands best, and how far it is off.

    Legs, trunk and head are upright, shoulders and hips face the same way, straight arms hang or
    are held out to the sides, both feet are level and nothing moves much. The distance has no
    unit and is less than 1. None if nobody stands.
    """
    up = UP[axis]
    thighs, shins = (
        _unit(np.stack([places[:, leg[k + 1]] - places[:, leg[k]] for leg in _LEGS], 1))
        for k in (0, 1)
    )
    trunk = _unit(places[:, J["neck"]] - places[:, J["pelvis"]])
    across = _unit(places[:, J["right_hip"]] - places[:, J["left_hip"]])
    hips = _level(across, up)
    shoulders = _level(places[:, J["right_shoulder"]] - places[:, J["left_shoulder"]], up)
    head = _unit(places[:, J["head"]] - places[:, J["neck"]])
    arms, forearms = (
        _unit(np.stack([places[:, arm[k + 1]] - places[:, arm[k]] for arm in _ARMS], 1))
        for k in (0, 1)
    )
    out = np.stack([-shoulders, shoulders], 1)
    held = np.minimum(_angle(arms @ -up), _angle((arms * out).sum(-1)))
    toes = _level(places[:, _FEET] - places[:, _ANKLES], up)
    ahead = np.cross(up, hips)
    legs = np.stack([_angle(thighs @ -up), _angle(shins @ -up)]).max((0, 2))
    away = np.stack(
        [
            legs,
            _angle(trunk @ up),
            np.arcsin(np.clip(across @ up, -1, 1)),
            _angle((hips * shoulders).sum(-1)),
            _angle(head @ up),
            held.max(-1),
            _angle((arms * forearms).sum(-1)).max(-1),
        ]
    )
    off = (np.abs(away) / _STANDING[:, None]).max(0)
    leg = np.linalg.norm(np.diff(places[:, _LEGS[0]], axis=1), axis=-1).sum(-1).mean()
    feet = places[:, _FEET] @ up
    speed = np.linalg.norm(np.gradient(places, axis=0), axis=-1).max(-1) * fps / leg
    forward = (toes * ahead[:, None]).sum(-1).min(-1) > 0
    good = (off < 1) & (speed < STILL) & (np.abs(feet[:, 0] - feet[:, 1]) < 0.05 * leg) & forward
    if not good.any():
        return None
    off[~good] = np.inf
    best = int(np.argmin(off + speed))
    return best, float(off[best])


def _level(vectors: Array, up: Array) -> Array:
    return _unit(vectors - (vectors @ up)[..., None] * up)


def _angle(cosines: Array) -> Array:
    return np.arccos(np.clip(cosines, -1, 1))
