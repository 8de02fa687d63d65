"""Guards: a step that no body could take is repaired before it is sent, or continued from.

    knees   are kept within what a knee can do
    falls   a body that leans or squats as no walker does, or that cannot be shown at all, gets up
            to a stand in the course of one step

Repairs are rare; without one the output has the same bits. Pure functions of
columns; rows do not influence each other. Angles in radians, frames at 40 per second.
"""

from math import cos, radians, sin
from typing import Final

import numpy as np

from wayfarer.body.skeleton import joint_names
from wayfarer.spec import NEW_FRAMES, POSED_JOINTS
from wayfarer.world.agents.slots import Motion, Seeds
from wayfarer.world.output.legs import KNEES, Legs
from wayfarer.world.output.quaternion import Array, bounded, inverse, length, multiply, stacked
from wayfarer.world.rows import Flags, Float

KNEE: Final = (radians(-5), radians(150))
"""Range of a knee's bend, from straight."""

SIDEWAYS: Final = radians(30)
"""Angle that a knee is turned by at most beside its bend: people reach 31 degrees."""

FELL: Final = cos(radians(32))
"""Cosine of the lean beyond which a body has fallen; walking people never lean as far."""

FOLDED: Final = 0.76
"""Share of its standing hips' height below which a body has fallen."""

ARM_MOST: Final = radians(60)
"""Angle by which a joint of an arm turns at most while a body gets up."""


def _smoothest(path: Float) -> Float:
    """Turns [N, F, 4] between the second and the last of a joint's path [N, 2 + F, 4]: the cubic
    that begins and ends as fast as that path does.
    """
    turns = np.moveaxis(path, -1, 0).astype(np.float64)
    start = turns[:, :, 1]
    whole = _vector(multiply(inverse(start), turns[:, :, -1]))
    into = _vector(multiply(inverse(turns[:, :, 0]), start))
    out = _vector(multiply(inverse(turns[:, :, -2]), turns[:, :, -1]))
    frames = path.shape[1] - 2
    fast = np.maximum(length(whole), 1e-6) * 3 / frames
    into, out = (v * np.minimum(1, fast / np.maximum(length(v), 1e-9)) for v in (into, out))
    t = np.arange(1, frames + 1) / frames
    way = (
        whole[..., None] * (3 * t**2 - 2 * t**3)
        + frames * into[..., None] * (t - 2 * t**2 + t**3)
        + frames * out[..., None] * (t**3 - t**2)
    )
    found: Float = np.moveaxis(multiply(start[..., None], _turn(way)), 0, -1).astype(np.float32)
    return found


def _turn(vector: Array) -> Array:
    """Rotations [4, ...] about vectors [3, ...] by as many radians as these are long."""
    angle = np.maximum(length(vector), 1e-12)
    return np.concatenate([vector / angle * np.sin(angle / 2), np.cos(angle / 2)[None]])


def _vector(turn: Array) -> Array:
    """Axis times angle [3, ...] of rotations [4, ...], the shorter way round."""
    turn = turn * np.where(turn[3] < 0, -1, 1)
    sine = length(turn[:3])
    angle = 2 * np.arctan2(sine, turn[3])
    vector: Array = turn[:3] * (angle / np.maximum(sine, 1e-12))
    return vector


def bendable(rotations: Float, legs: Legs) -> Float:
    """Rotations [A, F, 22, 4] of a step with knees bent within `KNEE`, and no more than `SIDEWAYS`
    beside it; the same array if all are.
    """
    knees = np.moveaxis(rotations[:, :, KNEES], -1, 0)  # [4, A, F, 2]
    _, y, z, _ = knees
    beside = y * y + z * z
    if twisted := bool((beside > sin(SIDEWAYS / 2) ** 2).any()):
        knees = _straightened(knees, beside)
    bend = _flexion(knees, legs)
    low, high = KNEE
    excess = bend - bounded(bend, low, high)
    if not (twisted or excess.any()):
        return rotations
    half = excess / 2
    zero = np.zeros_like(half)
    limited = rotations.copy()
    turned = multiply(stacked(np.sin(half), zero, zero, np.cos(half)), knees)
    limited[:, :, KNEES] = np.moveaxis(np.where(excess == 0, knees, turned), 0, -1)
    return limited


def _straightened(knees: Array, beside: Array) -> Array:
    """Knees [4, A, F, 2] with as much of their turn about Y and Z left as they have; `beside` is
    the square of that part.
    """
    most = sin(SIDEWAYS / 2) ** 2
    less = np.sqrt(np.minimum(1, most / np.maximum(beside, 1e-12)))
    more = np.sqrt((1 - less * less * beside) / np.maximum(1 - beside, 1e-6))
    x, y, z, w = knees
    return np.where(beside > most, stacked(more * x, less * y, less * z, more * w), knees)


def _flexion(knees: Array, legs: Legs) -> Array:
    """Radians that knees [4, A, F, 2] are bent from straight, -90° … 270°: a knee that is beyond
    straight by more than a quarter turn has been folded through the thigh.
    """
    rest = np.moveaxis(legs.ankle, -1, 0)[:, :, None]  # [3, A, 1, 2] from the knee
    x, y, z, w = knees
    ahead = 2 * (x * y + w * z) * rest[0] + (1 - 2 * (x * x + z * z)) * rest[1]
    ahead += 2 * (y * z - w * x) * rest[2]
    up = 2 * (x * z - w * y) * rest[0] + 2 * (y * z + w * x) * rest[1]
    up += (1 - 2 * (x * x + y * y)) * rest[2]
    bend = np.arctan2(-ahead, -up) - np.arctan2(-rest[1], -rest[2])
    found: Array = (bend + np.pi / 2) % (2 * np.pi) - np.pi / 2
    return found


def fallen(translation: Float, rotations: Float, legs: Legs) -> Flags:
    """Bodies [A] that lean or squat at the end of their step: [A, F, 3], [A, F, 22, 4]."""
    upright, hips = bearing(translation, rotations, legs)
    found: Flags = (upright < FELL) | (hips < FOLDED)
    return found


def bearing(translation: Float, rotations: Float, legs: Legs) -> tuple[Float, Float]:
    """How upright bodies [A] are at the end of their step, as the cosine of their lean, and how
    high their hips, as a share of what they are in a stand: [A, F, 3], [A, F, 22, 4].
    """
    trunk = np.moveaxis(rotations[:, -1, [0, *_SPINE]], -1, 0)  # [4, A, 4]
    turn = trunk[:, :, 0]
    upright = np.zeros(len(translation), np.float32)
    for joint in range(1, 4):
        turn = multiply(turn, trunk[:, :, joint])
        x, y, _, _ = turn
        upright += (1 - 2 * (x * x + y * y)) / 3
    heel = legs.sole_of_ankle[:, :, 0, 2]
    height = -(legs.hip + legs.knee + legs.ankle)[..., 2].mean(1) - heel.mean(1)
    return upright, translation[:, -1, 2] / height


_SPINE: Final = [joint_names().index(f"spine{k}") for k in (1, 2, 3)]


def got_up(seed: Seeds, stand: Motion) -> tuple[Float, Float]:
    """Translation [A, F, 3] and rotations [A, F, 22, 4] from the end of `seed` to a `stand`.

    Arms that have farther to go than `ARM_MOST` get there with the next step: `stand` is changed to
    show them where they have come to.
    """
    t = (np.arange(1, NEW_FRAMES + 1) / NEW_FRAMES)[:, None]
    start, end = seed.translation[:, -1:], stand.seed.translation[:, -1:]
    speed = start - seed.translation[:, -2:-1]  # nobody who falls stops at once
    translation = start + (3 * t**2 - 2 * t**3) * (end - start)
    translation += NEW_FRAMES * (t - 2 * t**2 + t**3) * speed

    last = np.moveaxis(seed.rotations[:, -1], -1, 0)  # [4, A, 22]
    way = _vector(multiply(inverse(last), np.moveaxis(stand.seed.rotations[:, -1], -1, 0)))
    way[:, :, _ARMS] *= np.minimum(1, ARM_MOST / np.maximum(length(way[:, :, _ARMS]), 1e-9))
    end_turns = np.moveaxis(multiply(last, _turn(way)), 0, -1)[:, None]
    path = np.concatenate([seed.rotations, np.repeat(end_turns, NEW_FRAMES, axis=1)], 1)
    turns = np.stack([_smoothest(row.swapaxes(0, 1)).swapaxes(0, 1) for row in path])
    stand.seed.rotations[:, :, _ARMS] = turns[:, -1:, _ARMS]
    return translation.astype(np.float32), turns


_ARMS: Final = [
    number
    for number, name in enumerate(joint_names()[:POSED_JOINTS])
    if name.split("_")[-1] in ("shoulder", "elbow", "wrist")
]
