"""An agent's individual style: agents with the same command do not move alike.

Everything follows from the noise seed, so the same seed gives the same motion.

    reaction   a standing agent sets off at its own one of several moments, 0.2 s apart; this
               needs no memory of when the command came, and repeated commands do not delay it
    own noise  a part of the noise of each of its steps
    manner     an input of its policy, which may heed it or not
"""

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import LATENT, MANNER
from wayfarer.world.rows import Flags, Float, Index

Seeds = NDArray[np.uint64]

REMEMBERED: Final = 4096
"""Maximum number of draws that are kept."""

_REACTION, _OWN, _MANNER = range(1, 4)
"""Independent draws from one seed."""

_STEP: Final = 0x9E3779B97F4A7C15


def sets_off(noise_seed: Seeds, chunk: Index, moments: int) -> Flags:
    """Whether standing agents [A] may set off with this chunk: each with one in `moments`."""
    own = _mixed(noise_seed, _REACTION) % np.uint64(moments)
    found: Flags = (chunk.astype(np.uint64) + own) % np.uint64(moments) == 0
    return found


def own_noise(noise_seed: Seeds) -> Float:
    """Latents [A, 128] ~ N(0, I), constant for each agent."""
    return _constant(noise_seed, _OWN, LATENT)


def manner(noise_seed: Seeds) -> Float:
    """Manners [A, 8] ~ N(0, I), constant for each agent."""
    return _constant(noise_seed, _MANNER, MANNER)


def _constant(noise_seed: Seeds, draw: int, size: int) -> Float:
    if not len(noise_seed):
        return np.zeros((0, size), np.float32)
    found = np.concatenate([_normals(seed, draw, size) for seed in noise_seed.tolist()])
    return found.reshape(-1, size)  # `np.stack` would inspect each of them


@lru_cache(2 * REMEMBERED)
def _normals(noise_seed: int, draw: int, size: int) -> Float:
    bits = np.random.Philox(key=np.array([noise_seed, draw], np.uint64))
    return np.random.Generator(bits).standard_normal(size, dtype=np.float32)


def _mixed(noise_seed: Seeds, draw: int) -> Seeds:
    """64 bits of each seed, spread evenly (the finaliser of SplitMix64)."""
    bits = noise_seed + np.uint64(draw * _STEP % 2**64)
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))
