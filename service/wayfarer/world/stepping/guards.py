"""Guards: a step that no body could take is repaired before it is sent, or continued from.

    knees   are kept within a knee's limits
    falls   a body that leans or squats as no walker does, or that cannot be shown at all, gets up
            to a stand within one step

Repairs are rare; without one the output has the same bits. Pure functions of columns; rows do not
influence each other. Angles in radians, frames at 40 per second.
"""

from math import atan2, cos, pi, radians, sin, sqrt
from typing import Final

import numpy as np

from wayfarer.body.skeleton import joint_names
from wayfarer.process.compiled import compiled, inner
from wayfarer.spec import NEW_FRAMES, POSED_JOINTS
from wayfarer.world.agents.slots import Motion, Seeds
from wayfarer.world.output import quaternion
from wayfarer.world.output.legs import KNEES, Bones
from wayfarer.world.output.quaternion import Array, length
from wayfarer.world.output.turns import (
    Turn,
    Vector,
    add,
    bounded,
    multiply,
    put,
    rotate,
    turn,
    vector,
)
from wayfarer.world.rows import Flags, Float

KNEE: Final = (radians(-5), radians(150))
"""Range of a knee's bend, from straight."""

SIDEWAYS: Final = radians(30)
"""Maximum angle by which a knee is turned beside its bend: people reach 31 degrees."""

MOST_BESIDE: Final = sin(SIDEWAYS / 2) ** 2
"""Square of the part of a knee's quaternion beside its bend, at that angle."""

FELL: Final = cos(radians(32))
"""Cosine of the lean beyond which a body has fallen; walking people never lean that far."""

FOLDED: Final = 0.76
"""Share of its standing hips' height below which a body has fallen."""

ARM_MOST: Final = radians(60)
"""Maximum angle by which a joint of an arm turns while a body gets up."""

SPINE: Final = tuple(joint_names().index(f"spine{k}") for k in (1, 2, 3))


def _smoothest(path: Float) -> Float:
    """Rotations [N, F, 4] between the second and the last of a joint's path [N, 2 + F, 4]: the
    cubic that begins and ends at the path's speeds.
    """
    turns = np.moveaxis(path, -1, 0).astype(np.float64)
    start = turns[:, :, 1]
    whole = _vector(quaternion.multiply(quaternion.inverse(start), turns[:, :, -1]))
    into = _vector(quaternion.multiply(quaternion.inverse(turns[:, :, 0]), start))
    out = _vector(quaternion.multiply(quaternion.inverse(turns[:, :, -2]), turns[:, :, -1]))
    frames = path.shape[1] - 2
    fast = np.maximum(length(whole), 1e-6) * 3 / frames
    into, out = (v * np.minimum(1, fast / np.maximum(length(v), 1e-9)) for v in (into, out))
    t = np.arange(1, frames + 1) / frames
    way = (
        whole[..., None] * (3 * t**2 - 2 * t**3)
        + frames * into[..., None] * (t - 2 * t**2 + t**3)
        + frames * out[..., None] * (t**3 - t**2)
    )
    found: Float = np.moveaxis(quaternion.multiply(start[..., None], _turn(way)), 0, -1).astype(
        np.float32
    )
    return found


def _turn(vector: Array) -> Array:
    """Rotations [4, ...] about vectors [3, ...] by their lengths in radians."""
    angle = np.maximum(length(vector), 1e-12)
    return np.concatenate([vector / angle * np.sin(angle / 2), np.cos(angle / 2)[None]])


def _vector(turn: Array) -> Array:
    """Axis times angle [3, ...] of rotations [4, ...], the shorter way round."""
    turn = turn * np.where(turn[3] < 0, -1, 1)
    sine = length(turn[:3])
    angle = 2 * np.arctan2(sine, turn[3])
    vector: Array = turn[:3] * (angle / np.maximum(sine, 1e-12))
    return vector


@compiled
def bend_rows(rotations: Float, rest: Float, mended: Flags) -> None:
    """Bends the knees of rotations [A, F, 22, 4] within `KNEE`, and by `SIDEWAYS` at most to the
    side; `rest` [A, 2, 3] are the ankles' places in the T-pose, from the knees. Marks mended rows.
    """
    for row in range(len(rotations)):
        for foot in range(2):
            shin = vector(rest, (row, foot))
            hanging = atan2(-shin[1], -shin[2])
            for frame in range(rotations.shape[1]):
                at = row, frame, KNEES[foot]
                knee = turn(rotations, at)
                beside = knee[1] * knee[1] + knee[2] * knee[2]
                twisted = beside > MOST_BESIDE
                if twisted:
                    knee = _straightened(knee, beside)
                ahead, up = rotate(knee, shin)[1:]
                # -90° … 270°: a knee that is beyond straight by more than a quarter turn has been
                # folded through the thigh
                bend = (atan2(-ahead, -up) - hanging + pi / 2) % (2 * pi) - pi / 2
                half = (bend - bounded(bend, KNEE[0], KNEE[1])) / 2
                if twisted or half != 0:
                    mended[row] = True
                    put(rotations, at, multiply((sin(half), 0.0, 0.0, cos(half)), knee))


@inner
def _straightened(knee: Turn, beside: float) -> Turn:
    """A knee whose rotation about Y and Z is limited; `beside` is the square of that part, and too
    large.
    """
    less = sqrt(MOST_BESIDE / beside)
    more = sqrt((1 - MOST_BESIDE) / max(1 - beside, 1e-6))
    return more * knee[0], less * knee[1], less * knee[2], more * knee[3]


@compiled
def bear_rows(
    translation: Float, rotations: Float, legs: Bones, upright: Float, height: Float
) -> None:
    """Posture of bodies [A] at the end of their step: cosine of their lean, and their hips' height
    relative to that in a stand; [A, F, 3], [A, F, 22, 4]. See `FELL` and `FOLDED`.
    """
    last = rotations.shape[1] - 1
    for row in range(len(rotations)):
        stand = 0.0
        for foot in range(2):
            to_ankle = legs.hip[row, foot, 2] + legs.knee[row, foot, 2] + legs.ankle[row, foot, 2]
            stand -= (float(to_ankle) + float(legs.sole_of_ankle[row, foot, 0, 2])) / 2
        upright[row] = spine_up(rotations, row)[2]
        height[row] = translation[row, last, 2] / stand


@inner
def spine_up(rotations: Float, row: int) -> Vector:
    """Mean up direction of the joints of a row's spine in the last frame of [A, F, 22, 4]."""
    frame = rotations.shape[1] - 1
    above, up = turn(rotations, (row, frame, 0)), (0.0, 0.0, 0.0)
    for joint in SPINE:
        above = multiply(above, turn(rotations, (row, frame, joint)))
        up = add(up, rotate(above, (0.0, 0.0, 1 / 3)))
    return up


def got_up(seed: Seeds, stand: Motion) -> tuple[Float, Float]:
    """Translation [A, F, 3] and rotations [A, F, 22, 4] from the end of `seed` to a `stand`.

    Arms that must turn farther than `ARM_MOST` arrive with the next step: `stand` is changed to
    show their intermediate pose.
    """
    t = (np.arange(1, NEW_FRAMES + 1) / NEW_FRAMES)[:, None]
    start, end = seed.translation[:, -1:], stand.seed.translation[:, -1:]
    speed = start - seed.translation[:, -2:-1]  # a falling body does not stop at once
    translation = start + (3 * t**2 - 2 * t**3) * (end - start)
    translation += NEW_FRAMES * (t - 2 * t**2 + t**3) * speed

    last = np.moveaxis(seed.rotations[:, -1], -1, 0)  # [4, A, 22]
    way = _vector(
        quaternion.multiply(
            quaternion.inverse(last), np.moveaxis(stand.seed.rotations[:, -1], -1, 0)
        )
    )
    way[:, :, _ARMS] *= np.minimum(1, ARM_MOST / np.maximum(length(way[:, :, _ARMS]), 1e-9))
    end_turns = np.moveaxis(quaternion.multiply(last, _turn(way)), 0, -1)[:, None]
    path = np.concatenate([seed.rotations, np.repeat(end_turns, NEW_FRAMES, axis=1)], 1)
    turns = np.stack([_smoothest(row.swapaxes(0, 1)).swapaxes(0, 1) for row in path])
    stand.seed.rotations[:, :, _ARMS] = turns[:, -1:, _ARMS]
    return translation.astype(np.float32), turns


_ARMS: Final = [
    number
    for number, name in enumerate(joint_names()[:POSED_JOINTS])
    if name.split("_")[-1] in ("shoulder", "elbow", "wrist")
]
