"""Two-bone inverse kinematics: ankles are moved, knees stay in their plane, feet keep their turn.

Arrays have their components first, see `quaternion.py`; 2 legs, F frames, A agents.
"""

from typing import Final

import numpy as np

from wayfarer.world.output.legs import ANKLES, HIPS, KNEES, LegPose
from wayfarer.world.output.quaternion import (
    Array,
    bounded,
    cross,
    dot,
    inverse,
    length,
    multiply,
    rotate,
    stacked,
    unit,
)
from wayfarer.world.rows import Float

MOVED: Final = [*HIPS, *KNEES, *ANKLES]
"""Joints whose rotations change."""

STRETCH: Final = 0.999
"""A leg is stretched to this share of its length at most: beyond, a straight knee would snap."""

FOLD: Final = 0.3
"""And folded to this share at most."""

TINY: Final = 1e-9
"""Square metres: a leg without length is not swung."""

STRAIGHT: Final = 0.25
"""Sine of the knee's bend below which its plane is taken from the hip's side axis by degrees: that
of a leg that is nearly straight swings about with the least turn, and that of one bent the wrong
way is the wrong way round."""


FREE: Final = np.float32(0.5)
"""Share of the way from a leg's length to its full one that it is stretched by at once; the rest is
approached ever more slowly, so that a knee does not snap straight."""


def move_feet(
    pose: LegPose, translation: Float, shift: Array, turn: Array, free: Array | np.float32 = FREE
) -> Array:
    """As `move_ankles`, with each foot first turned by `turn` radians [2, F, A] about the vertical
    through the middle of its sole; translation [A, F, 3].

    The knee turns half as far with it.
    """
    root = translation.transpose(2, 1, 0)[:, None]
    arm = (pose.ankle + root)[:2] - pose.soles[:2].mean(1)
    cos, sin = np.cos(turn) - 1, np.sin(turn)
    off = stacked(cos * arm[0] - sin * arm[1], sin * arm[0] + cos * arm[1], np.zeros_like(sin))
    return move_ankles(pose, shift + off, turn, free)


def move_ankles(
    pose: LegPose, shift: Array, turn: Array | None = None, free: Array | np.float32 = FREE
) -> Array:
    """Local rotations [A, F, 6, 4] of the joints `MOVED`, with the ankles `shift` [3, 2, F, A] off.

    An ankle that is out of reach goes as far as `reach` lets it, `free` [F, A] as there, in the
    direction of its target.
    Feet keep their turn in the world, unless it is changed by `turn` [2, F, A], radians.
    """
    thigh, shin = pose.knee - pose.hip, pose.ankle - pose.knee
    upper, lower = length(thigh), length(shin)
    straight, target = pose.ankle - pose.hip, pose.ankle + shift - pose.hip
    before = length(straight)
    after = reach(before, length(target), upper + lower, free)

    side = rotate(pose.hip_turn, np.array([-1, 0, 0], shift.dtype).reshape(3, 1, 1, 1))
    plane = cross(thigh, shin) / np.maximum(upper * lower, TINY)
    forward = dot(plane, side)  # sine of the bend; below 0 where the knee is beyond straight
    axis = unit(plane + (np.maximum(-2 * forward, 0) + STRAIGHT) * side)
    # Law of cosines: the inner angle of the knee before and after; their difference bends it, from
    # beyond straight, too, and of a knee that is bent sideways by what is about the axis.
    inner = _knee(upper, lower, before)
    about = dot(plane, axis) / np.maximum(length(plane), TINY)
    reversed_ = np.pi - about * (np.pi - inner)
    inner = np.where(forward < 0, reversed_, inner).astype(shift.dtype)
    half_bend = 0.5 * (inner - _knee(upper, lower, after))
    bend = unit(_quaternion(axis * np.sin(half_bend), np.cos(half_bend)))

    # The shortest arc that swings the bent leg onto its target; half angles by |a||b| + a·b.
    ankle = thigh + rotate(bend, shin)
    arc = dot(ankle, target) + length(ankle) * length(target) + TINY
    swing = unit(_quaternion(cross(ankle, target), arc))

    foot_turn = pose.ankle_turn
    if turn is not None:
        half = turn / 4
        along = unit(target) * np.where(target[2] < 0, np.float32(-1), np.float32(1))
        swing = multiply(_quaternion(along * np.sin(half), np.cos(half)), swing)
        zero = np.zeros_like(turn)
        foot_turn = multiply(stacked(zero, zero, np.sin(turn / 2), np.cos(turn / 2)), foot_turn)
    hip = multiply(swing, pose.hip_turn)
    knee = multiply(swing, multiply(bend, pose.knee_turn))
    turns = [
        multiply(inverse(pose.root_turn), hip),
        multiply(inverse(hip), knee),
        multiply(inverse(knee), foot_turn),
    ]
    return np.concatenate(turns, 1).transpose(3, 2, 1, 0)


def reach(before: Array, wanted: Array, leg: Array, free: Array | np.float32 = FREE) -> Array:
    """Distance from hip to ankle that a leg takes when it is `wanted`; metres, all shapes alike.

    Of the way from `before` to the full length a share is `free`, see `FREE`.
    """
    way = STRETCH * leg - before
    near, rest = np.maximum(free * way, 1e-6), np.maximum((1 - free) * way, 1e-6)
    more = wanted - before
    beyond = np.maximum(more - near, 0)
    eased = np.minimum(more, near) + rest * (1 - np.exp(-beyond / rest))
    return np.maximum(before + eased, np.minimum(before, FOLD * leg))


def _knee(upper: Array, lower: Array, distance: Array) -> Array:
    both = np.maximum(2 * upper * lower, 1e-12)
    return np.arccos(bounded((upper**2 + lower**2 - distance**2) / both, -1, 1))


def _quaternion(vector: Array, scalar: Array) -> Array:
    return np.concatenate([vector, scalar[None]])
