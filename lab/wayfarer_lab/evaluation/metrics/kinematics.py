"""Speed and smoothness of points: pure functions of arrays.

Metres and seconds. Points have shape [..., T, P, 3]: T frames at `FPS`, P markers or joints.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument
from wayfarer.spec import FPS, NEW_FRAMES

Array = NDArray[np.floating[Any]]

SPEED_HOP: Final = 10
"""Frames between the places whose distances make a speed: 0.25 s, so sway hardly counts."""

WALKING_SPEED: Final = (0.9, 1.4)
"""Metres per second: windows in this range are compared with each other (*speed-matched*)."""


def velocity(points: Array) -> Array:
    """m/s, central differences inside, one-sided at the ends. Shape as `points`."""
    return np.gradient(points, 1.0 / FPS, axis=-3)


def acceleration(points: Array) -> Array:
    """|p(t-1) - 2 p(t) + p(t+1)| · FPS², m/s², of inner frames 1 … T-2. [..., T-2, P]"""
    return np.linalg.norm(np.diff(points, 2, axis=-3), axis=-1) * FPS**2


def jerk(points: Array) -> Array:
    """Norm of the third difference · FPS³, m/s³. [..., T-3, P]"""
    return np.linalg.norm(np.diff(points, 3, axis=-3), axis=-1) * FPS**3


def seam_ratio(points: Array, first_seam: int = 0, every: int = NEW_FRAMES) -> float:
    """Mean acceleration across the seams of primitives ÷ elsewhere; 1 means that no seam shows.

    A seam lies before each frame `first_seam + k · every`; the two second differences that
    straddle it (centred on the frames before and after it) count as *at the seam*.
    """
    values = acceleration(points)
    centre = np.arange(1, points.shape[-3] - 1)
    phase = (centre - first_seam) % every
    at_seam = (phase == 0) | (phase == every - 1)
    if at_seam.all() or not at_seam.any():
        raise InvalidArgument(f"{points.shape[-3]} frames hold no seam, or nothing but seams")
    elsewhere = float(values[..., ~at_seam, :].mean())
    return float(values[..., at_seam, :].mean()) / max(elsewhere, 1e-9)


def travel_speed(hips: Array) -> Array:
    """Mean horizontal speed, m/s, of hips [..., T, 3], from hops of 10 frames (0.25 s). [...]

    Needs 11 frames at least; frames after the last whole hop do not count.
    """
    places = hips[..., ::SPEED_HOP, :2]
    if places.shape[-2] < 2:
        raise InvalidArgument(f"a speed needs {SPEED_HOP + 1} frames, got {hips.shape[-2]}")
    return np.linalg.norm(np.diff(places, axis=-2), axis=-1).mean(-1) * FPS / SPEED_HOP


def at_walking_speed(hips: Array) -> NDArray[np.bool_]:
    """Windows whose `travel_speed` lies in 0.9 … 1.4 m/s. [...]"""
    low, high = WALKING_SPEED
    speed = travel_speed(hips)
    return (speed >= low) & (speed <= high)


def deformation(points: Array) -> Array:
    """How far points of one rigid part of the body move against each other, metres. [...]

    The sum over all pairs of the standard deviation over time of their distance (MOJO, Tab. 3;
    paper Sec. A.4). It grows with the length of the motion: compare equal lengths.
    """
    first, second = np.triu_indices(points.shape[-2], 1)
    distance = np.linalg.norm(points[..., first, :] - points[..., second, :], axis=-1)
    return distance.std(-2).sum(-1)


def windows(track: Array, frames: int) -> Array:
    """Consecutive whole windows of a track [T, ...], without overlap: [W, frames, ...]."""
    whole = len(track) // frames
    return track[: whole * frames].reshape(whole, frames, *track.shape[1:])
