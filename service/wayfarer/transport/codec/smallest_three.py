"""Unit quaternions in 48 bits: the three smallest components, 15 bits each.

The component of greatest magnitude (the first of several equal ones) is omitted, since it follows
from the length 1. If it is negative, all four change sign, which gives the same rotation. The other
three, in the order x, y, z, w, lie in [-1/√2, 1/√2] and are counted in steps of 1/(16383 √2); the
count 16383 is exactly 0. Three little-endian 16-bit words hold

    word 0: bits 0-14 first component,  bit 15: bit 0 of the index of the omitted one
    word 1: bits 0-14 second component, bit 15: bit 1 of that index
    word 2: bits 0-14 third component,  bit 15: 0
"""

from typing import Final

import numpy as np

from wayfarer.process.compiled import compiled, inner

MIDDLE: Final = 16383
"""The count that stands for 0."""

STEPS_PER_ONE: Final = MIDDLE * 2**0.5
FACTOR: Final = np.float32(STEPS_PER_ONE)

WORST_ERROR_DEG: Final = 0.0086
"""Maximum angle between a rotation and its decoded value: half a step in each of three components,
with all four at 1/2, is 4 √3 · (1/2) / (16383 √2) rad; float32 adds less than 0.0001°.
"""


@compiled
def pack_one(x: float, y: float, z: float, w: float) -> tuple[int, int, int]:
    """The words of a unit quaternion of float32 numbers."""
    counts = _count(x), _count(y), _count(z), _count(w)
    out = 0
    for k in range(1, 4):
        if abs(counts[k]) > abs(counts[out]):
            out = k
    sign = -1 if counts[out] < 0 else 1
    first = counts[1] if out == 0 else counts[0]
    second = counts[2] if out <= 1 else counts[1]
    third = counts[3] if out <= 2 else counts[2]
    return (
        _word(sign * first) | (out & 1) << 15,
        _word(sign * second) | (out >> 1) << 15,
        _word(sign * third),
    )


@inner
def _count(component: float) -> int:
    return int(np.rint(np.float32(component) * FACTOR))


@inner
def _word(count: int) -> int:
    return min(max(count, -MIDDLE), MIDDLE) + MIDDLE
