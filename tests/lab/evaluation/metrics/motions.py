"""Feet and bodies with defined motion."""

import numpy as np

from wayfarer.spec import FPS

SOLE = np.array([[0.0, -0.06], [-0.03, 0.13], [0.03, 0.13], [0.0, 0.2]])
"""Heel, both balls, toe of a foot that points ahead (+Y), from its ankle. Metres."""

WIDTH = 0.1
"""Metres from the middle of the body to either ankle."""


def seconds(length: float) -> np.ndarray:
    """Times of the frames of a motion [T]."""
    return np.arange(round(length * FPS)) / FPS


def feet(
    frames: int,
    place: np.ndarray | float = 0.0,
    height: np.ndarray | float = 0.0,
    turn: np.ndarray | float = 0.0,
    pitch: np.ndarray | float = 0.0,
) -> np.ndarray:
    """Soles [T, 2, 4, 3] of flat feet beside each other.

    Each of left and right, [T, 2] or broadcast to it: `place` ahead (m) or [T, 2, 2] (x, y),
    `height` (m), `turn` to the left (degrees) about the ankle, `pitch` (degrees): the heel rises
    and the foot rolls over its toe.
    """
    soles = np.zeros((frames, 2, 4, 3))
    height, turn, pitch = (
        np.broadcast_to(np.asarray(v, float), (frames, 2)) for v in (height, turn, pitch)
    )
    where = np.zeros((frames, 2, 2))
    where[..., 0] = [-WIDTH, WIDTH]
    given = np.asarray(place, float)
    if given.ndim == 3:
        where = where + given
    else:
        where[..., 1] += np.broadcast_to(given, (frames, 2))
    c, s = np.cos(np.radians(pitch)), np.sin(np.radians(pitch))
    toe = SOLE[3, 1]
    along = toe - (toe - SOLE[:, 1]) * c[..., None]
    rise = (toe - SOLE[:, 1]) * s[..., None]
    across = np.broadcast_to(SOLE[:, 0], along.shape)
    c, s = np.cos(np.radians(turn))[..., None], np.sin(np.radians(turn))[..., None]
    soles[..., 0] = where[..., :1] + across * c - along * s
    soles[..., 1] = where[..., 1:] + across * s + along * c
    soles[..., 2] = height[..., None] + rise
    return soles


def bump(frames: int, start: int, length: int, top: float) -> np.ndarray:
    """A swing [T]: 0, from `start` on for `length` frames a hump of height `top`, and 0 again."""
    found = np.zeros(frames)
    found[start : start + length] = top * np.sin(np.linspace(0, np.pi, length))
    return found


def ramp(frames: int, start: int, stop: int, top: float) -> np.ndarray:
    """0 until `start`, rising evenly to `top` at `stop`, and staying there. [T]"""
    return top * np.clip((np.arange(frames) - start) / (stop - start), 0, 1)
