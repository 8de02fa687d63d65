"""Smoothing over the frames of sent bodies: each is one of these functions, with its half-life.

A half-life is the time in seconds in which a value makes half of the way to where it should be.
"""

from math import log

import numpy as np

from wayfarer.spec import FPS
from wayfarer.world.rows import Array, Flags


def share(half_life: float) -> float:
    """Share of the remaining way that is made in a frame."""
    return 1 - 0.5 ** (1 / (half_life * FPS))


def followed(before: Array, wanted: Array, half_life: float) -> Array:
    """Values that follow `wanted` [..., F, A] from `before`, fast at first."""
    found, value, part = np.empty(wanted.shape, np.float32), before, share(half_life)
    for frame in range(wanted.shape[-2]):
        value = value + part * (wanted[..., frame, :] - value)
        found[..., frame, :] = value
    return found


def sprung(value: Array, rise: Array, wanted: Array, half_life: float) -> tuple[Array, Array]:
    """Values [F, ...] that a critically damped spring pulls to `wanted`, and the last rise.

    `rise` is the change in the frame before, which a spring keeps: it sets off and ends softly.
    """
    stiffness = 2 * log(2) / (half_life * FPS)
    found = np.empty(wanted.shape, np.float32)
    for frame, target in enumerate(wanted):
        rise = (rise + stiffness**2 * (target - value)) / (1 + stiffness) ** 2
        value = value + rise
        found[frame] = value
    return found, rise


def approached(before: Array, wanted: Array, held: Flags, fastest: float) -> Array:
    """Values that approach `wanted` [..., F, A] by at most `fastest` per second, unless `held`."""
    found, value, most = np.empty(wanted.shape, np.float32), before, np.float32(fastest / FPS)
    for frame in range(wanted.shape[-2]):
        change = np.minimum(np.maximum(wanted[..., frame, :] - value, -most), most)
        value = value + np.where(held[..., frame, :], np.float32(0), change)
        found[..., frame, :] = value
    return found
