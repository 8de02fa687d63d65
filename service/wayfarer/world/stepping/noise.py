"""Latent noise that depends only on the agent.

Philox is a counter-based generator: the key is the agent's noise seed, the counter the number of
its chunk. So an agent's noise does not depend on the batch, tick or machine of its step, and a run
can be repeated from the seed, or resumed in its middle. The numbers are numpy's, to the last bit;
setting a numpy generator for each row would take longer than drawing from it.
"""

from functools import cache
from math import exp
from typing import Final

import numpy as np
from numba.np.random import _constants as ziggurat
from numpy.typing import NDArray

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.spec import LATENT

_STREAM: Final = np.uint64(0x5741594641524552)
"""Second half of the key: separates our draws from others."""

_HALF: Final = np.uint64(32)
_LOWER: Final = np.uint64(0xFFFFFFFF)
_ROUNDS: Final = 10
_FACTORS: Final = np.uint64(0xD2E7470EE14C6C93), np.uint64(0xCA5A826395121157)
_STEPS: Final = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBB67AE8584CAA73B)

HEIGHTS: Final[NDArray[np.float32]] = ziggurat.fi_float
WIDTHS: Final[NDArray[np.float32]] = ziggurat.wi_float
SURE: Final[NDArray[np.uint32]] = ziggurat.ki_float
"""Numpy's tables of the ziggurat: by layer, the limit up to which a number is surely within it."""

_TAIL: Final = np.float32(3.6541528853610087963519472518)
"""The beginning of the tail of the ziggurat, whose 256 layers are in the tables."""
_SCALE: Final = np.float32(0.27366123732975827203338247596)
"""The inverse of `_TAIL`."""
_UNIT: Final = np.float32(2.0**-24)

Words = NDArray[np.int64]
"""Numbers of 32 bits."""


def latents(
    noise_seed: NDArray[np.uint64], chunk: NDArray[np.int64], candidates: int
) -> NDArray[np.float32]:
    """Standard normal candidates [A, K, 128] for chunk `chunk` [A] of agents `noise_seed` [A].

    The first K candidates are the same for every larger K.
    """
    noise = np.empty((len(noise_seed), candidates * LATENT), np.float32)
    words = np.empty(candidates * LATENT * 5 // 4, np.int64)  # three in a hundred more are used
    while not _draw(noise_seed, chunk, words, noise):
        words = np.empty(2 * len(words), np.int64)
    return noise.reshape(len(noise_seed), candidates, LATENT)


@cache
def prepare() -> None:
    """Compiles the generator, or loads it, before agents walk."""
    row = np.zeros(1, np.int64)
    warm(_draw, row.astype(np.uint64), row, np.empty(8, np.int64), np.empty((1, 1), np.float32))


@compiled
def _draw(
    seeds: NDArray[np.uint64], chunks: Words, words: Words, noise: NDArray[np.float32]
) -> bool:
    """Fills `noise` [A, N], using `words` as a row's supply; returns False if they do not suffice.

    This is the ziggurat of Marsaglia and Tsang (2000), as in numpy.
    """
    for row in range(len(noise)):
        _fill(words, seeds[row], np.uint64(chunks[row]))
        used = 0
        for k in range(noise.shape[1]):
            while True:
                if used == len(words):
                    return False
                bits = words[used]
                used += 1
                layer, size = bits & 0xFF, bits >> 9
                x = np.float32(size) * WIDTHS[layer]
                if bits & 0x100:
                    x = -x
                if size < SURE[layer]:
                    break
                if layer == 0:
                    x, used = _of_tail(words, used)
                    if used > len(words):
                        return False
                    x = -x if size & 0x100 else x
                    break
                if used == len(words):
                    return False
                rest = HEIGHTS[layer - 1] - HEIGHTS[layer]
                used += 1
                if rest * _uniform(words[used - 1]) + HEIGHTS[layer] < exp(-0.5 * float(x) * x):
                    break
            noise[row, k] = x
    return True


@inner
def _of_tail(words: Words, used: int) -> tuple[np.float32, int]:
    """A number of the tail, and the words used by then; more than the supply means too few."""
    while used + 2 <= len(words):
        x = -_SCALE * np.log1p(-_uniform(words[used]))
        y = -np.log1p(-_uniform(words[used + 1]))
        used += 2
        if y + y > x * x:
            return _TAIL + x, used
    return _TAIL, len(words) + 1


@inner
def _uniform(word: int) -> np.float32:
    return np.float32(word >> 8) * _UNIT


@inner
def _fill(words: Words, seed: np.uint64, chunk: np.uint64) -> None:
    """Writes Philox 4×64-10 (Salmon et al. 2011), the lower half of each number first."""
    for block in range(len(words) // 8):
        a, b, c, d = np.uint64(block + 1), chunk, np.uint64(0), np.uint64(0)
        left, right = seed, _STREAM
        for _ in range(_ROUNDS):
            high, low = _product(_FACTORS[0], a)
            higher, lower = _product(_FACTORS[1], c)
            a, b, c, d = higher ^ b ^ left, lower, high ^ d ^ right, low
            left, right = left + _STEPS[0], right + _STEPS[1]
        at = 8 * block
        words[at], words[at + 1] = a & _LOWER, a >> _HALF
        words[at + 2], words[at + 3] = b & _LOWER, b >> _HALF
        words[at + 4], words[at + 5] = c & _LOWER, c >> _HALF
        words[at + 6], words[at + 7] = d & _LOWER, d >> _HALF


@inner
def _product(a: np.uint64, b: np.uint64) -> tuple[np.uint64, np.uint64]:
    """Both halves of a 128-bit product."""
    a_low, a_high, b_low, b_high = a & _LOWER, a >> _HALF, b & _LOWER, b >> _HALF
    cross = a_high * b_low + ((a_low * b_low) >> _HALF)
    middle = a_low * b_high + (cross & _LOWER)
    return a_high * b_high + (cross >> _HALF) + (middle >> _HALF), a * b
