"""Two-bone inverse kinematics: ankles move, knees bend about a hinge, feet keep their rotation.

The hinge lies across the thigh. A sideways bend of the model's knee stays as it is, since
straightening it would take the knee beyond straight. A knee beyond straight is bent the right way,
and no knee is quite straight.
"""

from functools import cache
from math import acos, atan2, cos, exp, radians, sin, sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.spec import POSED_JOINTS
from wayfarer.world.output.legs import ANKLES, HIPS, KNEES, LegPose, Legs, pose_legs
from wayfarer.world.output.turns import (
    Turn,
    Vector,
    about,
    add,
    bounded,
    cross,
    dot,
    inverse,
    length,
    less,
    multiply,
    put,
    rotate,
    turn,
    vector,
)
from wayfarer.world.rows import Float

MOVED: Final = [*HIPS, *KNEES, *ANKLES]
"""Joints whose rotations change."""

STRETCH: Final = 0.999
"""Maximum length of a leg, as a share of its full length: beyond, a straight knee would snap."""

FOLD: Final = 0.3
"""Minimum length of a leg, as a share of its full length."""

SOFT: Final = radians(4)
"""Radians by which a straight knee is bent; a knee that is bent by twice this stays as it is. A
bend grows with the root of a leg's shortening: without this, quite straight knees bent by 19
degrees in a frame when their foot was lifted. The foot comes up to half a millimetre short of its
place.
"""

TINY: Final = 1e-9
"""Square metres: a leg without length is not swung."""

FREE: Final = 0.5
"""Share of the way from a leg's length to its full length by which it is stretched freely. The rest
is approached ever more slowly, so that a knee does not snap straight.
"""


class Moved(NamedTuple):
    """Local rotations of a leg's joints."""

    hip: Turn
    knee: Turn
    ankle: Turn


@inner
def move_ankle(
    root_turn: Turn,
    hip_turn: Turn,
    knee_turn: Turn,
    ankle_turn: Turn,
    thigh: Vector,
    shin: Vector,
    shift: Vector,
) -> Moved:
    """A leg with its ankle moved by `shift`; rotations in the world, and vectors hip–knee–ankle.

    An ankle out of reach goes as far as `reach` allows in the direction of its target. The foot
    keeps its rotation in the world.
    """
    straight = add(thigh, shin)
    target = add(straight, shift)
    hinge = rotate(hip_turn, (-1.0, 0.0, 0.0))
    # A shin turned by φ about the hinge has thigh · shin = along + most · cos(φ + bend).
    along = dot(thigh, hinge) * dot(shin, hinge)
    level, upright = dot(thigh, shin) - along, dot(cross(thigh, shin), hinge)
    most = max(sqrt(level * level + upright * upright), TINY)
    fixed = dot(thigh, thigh) + dot(shin, shin) + 2 * along  # of the squared way to the ankle
    full = sqrt(max(fixed + 2 * most, TINY))
    after = reach(length(straight), length(target), full)
    bent = acos(bounded((after * after - fixed) / (2 * most), -1.0, 1.0))
    bent += max(2 * SOFT - bent, 0.0) ** 2 / (4 * SOFT)
    half_bend = 0.5 * (bent - atan2(upright, level))
    bend = about(hinge, sin(half_bend), cos(half_bend))

    # The shortest arc that swings the bent leg onto its target; half angles by |a||b| + a·b.
    ankle = add(thigh, rotate(bend, shin))
    arc = dot(ankle, target) + length(ankle) * length(target) + TINY
    across = cross(ankle, target)
    size = max(sqrt(dot(across, across) + arc * arc), 1e-12)
    swing = about(across, 1 / size, arc / size)

    hip = multiply(swing, hip_turn)
    knee = multiply(swing, multiply(bend, knee_turn))
    return Moved(
        multiply(inverse(root_turn), hip),
        multiply(inverse(hip), knee),
        multiply(inverse(knee), ankle_turn),
    )


@inner
def put_leg(rotations: Float, row: int, frame: int, foot: int, made: Moved) -> None:
    """Writes a leg's joints into rotations [A, F, 22, 4]."""
    put(rotations, (row, frame, HIPS[foot]), made.hip)
    put(rotations, (row, frame, KNEES[foot]), made.knee)
    put(rotations, (row, frame, ANKLES[foot]), made.ankle)


@compiled
def move_ankles(pose: LegPose, shift: Float, rotations: Float) -> None:
    """Moves both legs of A agents in F frames by `shift` [A, F, 2, 3]; writes into rotations [A, F,
    22, 4].
    """
    for row in range(len(rotations)):
        for frame in range(rotations.shape[1]):
            root = turn(pose.root_turn, (row, frame))
            for foot in range(2):
                at = row, frame, foot
                knee = vector(pose.knee, at)
                made = move_ankle(
                    root,
                    turn(pose.hip_turn, at),
                    turn(pose.knee_turn, at),
                    turn(pose.ankle_turn, at),
                    less(knee, vector(pose.hip, at)),
                    less(vector(pose.ankle, at), knee),
                    vector(shift, at),
                )
                put_leg(rotations, row, frame, foot, made)


@cache
def prepare() -> None:
    """Compiles the kinematics, or loads them, before agents walk."""
    turns = np.ones((1, 1, POSED_JOINTS, 4), np.float32)
    pose = pose_legs(Legs.empty(1), np.zeros((1, 1, 3), np.float32), turns)
    warm(move_ankles, pose, np.zeros_like(pose.ankle), turns)


@compiled
def reach(before: float, wanted: float, leg: float) -> float:
    """Metres from hip to ankle that a leg takes for a `wanted` distance.

    A share of the way from `before` to the full length is free; see `FREE`.
    """
    way = STRETCH * leg - before
    near, rest = max(FREE * way, 1e-6), max((1 - FREE) * way, 1e-6)
    more = wanted - before
    beyond = max(more - near, 0.0)
    eased = min(more, near) + rest * (1 - exp(-beyond / rest))
    return max(before + eased, min(before, FOLD * leg))
