"""Two-bone inverse kinematics: ankles are moved, knees bend about a hinge, feet keep their turn.

The hinge lies across the thigh. What the model bends a knee sideways by stays as it is: to
straighten that, too, would take the knee beyond straight. A knee that is beyond straight is bent
the right way, and none is quite straight.

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
    unit,
)

MOVED: Final = [*HIPS, *KNEES, *ANKLES]
"""Joints whose rotations change."""

STRETCH: Final = 0.999
"""A leg is stretched to this share of its length at most: beyond, a straight knee would snap."""

FOLD: Final = 0.3
"""And folded to this share at most."""

SOFT: Final = np.float32(np.radians(4))
"""Radians that a straight knee is bent by; one that is bent by twice as much stays as it is. A bend
grows with the root of what its leg is shortened by: knees that were quite straight when their foot
was lifted bent by 19 degrees in a frame. The foot comes up to half a millimetre short of its place.
"""

TINY: Final = 1e-9
"""Square metres: a leg without length is not swung."""

FREE: Final = np.float32(0.5)
"""Share of the way from a leg's length to its full one that it is stretched by at once; the rest is
approached ever more slowly, so that a knee does not snap straight."""


def move_ankles(pose: LegPose, shift: Array) -> Array:
    """Local rotations [A, F, 6, 4] of the joints `MOVED`, with the ankles `shift` [3, 2, F, A] off.

    An ankle that is out of reach goes as far as `reach` lets it in the direction of its target.
    Feet keep their turn in the world.
    """
    thigh, shin = pose.knee - pose.hip, pose.ankle - pose.knee
    straight, target = pose.ankle - pose.hip, pose.ankle + shift - pose.hip
    hinge = rotate(pose.hip_turn, np.array([-1, 0, 0], shift.dtype).reshape(3, 1, 1, 1))
    # A shin turned by φ about the hinge has thigh · shin = along + most · cos(φ + bend).
    along = dot(thigh, hinge) * dot(shin, hinge)
    level, upright = dot(thigh, shin) - along, dot(cross(thigh, shin), hinge)
    most = np.maximum(np.sqrt(level * level + upright * upright), TINY)
    fixed = dot(thigh, thigh) + dot(shin, shin) + 2 * along  # of the squared way to the ankle
    full = np.sqrt(np.maximum(fixed + 2 * most, TINY))
    after = reach(length(straight), length(target), full)
    bent = np.arccos(bounded((after * after - fixed) / (2 * most), -1, 1))
    bent = bent + np.maximum(2 * SOFT - bent, 0) ** 2 / (4 * SOFT)
    half_bend = 0.5 * (bent - np.arctan2(upright, level))
    bend = _quaternion(hinge * np.sin(half_bend), np.cos(half_bend))

    # The shortest arc that swings the bent leg onto its target; half angles by |a||b| + a·b.
    ankle = thigh + rotate(bend, shin)
    arc = dot(ankle, target) + length(ankle) * length(target) + TINY
    swing = unit(_quaternion(cross(ankle, target), arc))

    hip = multiply(swing, pose.hip_turn)
    knee = multiply(swing, multiply(bend, pose.knee_turn))
    turns = [
        multiply(inverse(pose.root_turn), hip),
        multiply(inverse(hip), knee),
        multiply(inverse(knee), pose.ankle_turn),
    ]
    return np.concatenate(turns, 1).transpose(3, 2, 1, 0)


def reach(before: Array, wanted: Array, leg: Array) -> Array:
    """Distance from hip to ankle that a leg takes when it is `wanted`; metres, all shapes alike.

    Of the way from `before` to the full length a share is free, see `FREE`.
    """
    way = STRETCH * leg - before
    near, rest = np.maximum(FREE * way, 1e-6), np.maximum((1 - FREE) * way, 1e-6)
    more = wanted - before
    beyond = np.maximum(more - near, 0)
    eased = np.minimum(more, near) + rest * (1 - np.exp(-beyond / rest))
    return np.maximum(before + eased, np.minimum(before, FOLD * leg))


def _quaternion(vector: Array, scalar: Array) -> Array:
    return np.concatenate([vector, scalar[None]])
