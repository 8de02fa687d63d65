"""Angles and places of joints: knees, head, lean, pops, turning. Pure functions of arrays.

World space, metres, Z up, 40 fps. T frames, J joints. Left comes before right.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS

Array = NDArray[np.floating[Any]]

RATE_REACH: Final = 1
"""Frames on either side over which a turning rate is taken: 0.05 s in all."""


def knee_flexion(knees: Array, shins: Array) -> Array:
    """Degrees by which each knee is bent, 0 as in the T-pose, negative beyond it. [T, 2]

    knees [T, 2, 3, 3] are the local rotations of the knee joints; shins [2, 3] run from knee to
    ankle in the T-pose (right, forward, up). The angle is that of the shin in the sagittal plane
    of the thigh, from -180 to 180, so a knee that is turned inside out does not look bent.
    """
    shin = (knees @ shins[..., None])[..., 0]
    bent = np.arctan2(-shin[..., 1], -shin[..., 2]) - np.arctan2(-shins[..., 1], -shins[..., 2])
    return np.degrees((bent + np.pi) % (2 * np.pi) - np.pi)


def head_pitch(heads: Array) -> Array:
    """Degrees that heads [..., 3, 3] (world rotations) look up; negative: down. [...]"""
    return np.degrees(np.arcsin(np.clip(heads[..., 2, 1], -1, 1)))


def body_lean(ankles: Array, heads: Array) -> Array:
    """Degrees between the vertical and the line from the middle of the ankles to the head: the
    lean of the whole body. ankles [..., 2, 3], heads [..., 3]. [...]
    """
    line = heads - ankles.mean(-2)
    return np.degrees(np.arctan2(np.linalg.norm(line[..., :2], axis=-1), line[..., 2]))


def pops(joints: Array) -> Array:
    """Largest jump in the velocity of any of joints [T, J, 3], cm per frame², of inner frames.
    [T - 2]
    """
    return 100 * np.linalg.norm(np.diff(joints, 2, axis=0), axis=-1).max(-1)


def turning_rate(heading: Array) -> Array:
    """Degrees per second of a heading [T] in degrees, over 0.05 s around each frame; 0 at both
    ends. [T]
    """
    rate = np.zeros(len(heading))
    reach = RATE_REACH
    if len(heading) > 2 * reach:
        rate[reach:-reach] = (heading[2 * reach :] - heading[: -2 * reach]) * FPS / (2 * reach)
    return rate


def turn_seconds(turned: Array, target: float) -> float:
    """Seconds from 10 % to 90 % of a turn of `target` degrees; turned [T] since the order.

    NaN when the turn is never done to 90 %, or there is none.
    """
    if not target:
        return float("nan")
    part = turned / target
    done = np.flatnonzero(part >= 0.9)
    if not len(done):
        return float("nan")
    begun = np.flatnonzero(part[: done[0] + 1] < 0.1)
    return float(done[0] - (begun[-1] + 1 if len(begun) else 0)) / FPS


def apart_along(ankles: Array, facing: Array) -> Array:
    """Metres from ankle to ankle along the direction faced. [..., 2, 3], [..., 2] → [...]"""
    return np.abs(((ankles[..., 0, :2] - ankles[..., 1, :2]) * facing).sum(-1))


def hands_ahead(wrists: Array, hips: Array, facing: Array) -> Array:
    """Metres that each wrist is ahead of the hips, the way that these face.

    wrists [..., 2, 3], hips [..., 3], facing [..., 2]. [..., 2]
    """
    away = (wrists - hips[..., None, :])[..., :2]
    ahead: Array = (away * facing[..., None, :]).sum(-1)
    return ahead
