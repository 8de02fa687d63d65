"""Differences between people with the same orders."""

import itertools
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

PHASES: Final = 32
"""Moments of a cycle that are compared."""


def phase_order(phases: Array) -> Array:
    """Degree to which N people walk in step: |mean exp(2πi phase)| of phases [N, T], NaN left
    out: from 0, no order, to 1, a march (Kuramoto's order parameter). [T]

    N people at random have 0.9 / √N in the mean.
    """
    with np.errstate(invalid="ignore"):
        turned = np.exp(2j * np.pi * phases)
        known = np.isfinite(phases)
        total = np.where(known, turned, 0).sum(0)
    count = known.sum(0)
    return np.abs(np.where(count > 1, total, np.nan) / np.maximum(count, 1))


def mean_cycle(rotations: Array, strikes: NDArray[np.int64]) -> Array | None:
    """The mean gait cycle: local rotations [T, J, 4] at `PHASES` moments between strikes of one
    foot, mean over strides. [PHASES, J, 4]; None without a whole stride.
    """
    strides = [
        rotations[np.round(np.linspace(a, b, PHASES, endpoint=False)).astype(int)]
        for a, b in itertools.pairwise(strikes)
    ]
    return mean_rotation(np.stack(strides)) if strides else None


def mean_rotation(quaternions: Array) -> Array:
    """Mean over axis 0 of unit quaternions that are near each other: [N, ..., 4] → [..., 4]."""
    sign = np.sign((quaternions * quaternions[:1]).sum(-1, keepdims=True))
    total = (quaternions * np.where(sign == 0, 1, sign)).sum(0)
    return total / np.linalg.norm(total, axis=-1, keepdims=True)


def cycle_spread(cycles: Sequence[Array]) -> float:
    """Degrees by which people's mean gait cycles [PHASES, J, 4] differ: the standard deviation over
    people of each joint's rotation about each of three axes, mean over joints and moments.
    """
    every = np.stack(cycles)
    cosine = np.abs((every * mean_rotation(every)).sum(-1)).clip(max=1)
    angle = np.degrees(2 * np.arccos(cosine))
    # of three axes together the square is three times that of one
    return float(np.sqrt((angle**2).sum(0) / (3 * max(len(every) - 1, 1))).mean())
