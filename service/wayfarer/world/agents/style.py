"""An agent's individual style: agents with the same command do not move alike.

Everything follows from the noise seed, so the same seed gives the same motion.

    reaction   a standing agent sets off at its own one of several moments, 0.2 s apart: that needs
               no memory of when the command came, and repeated commands do not delay it
    manner     a latent of its own, which each of its steps is drawn towards
    stride     how long its steps are, and thereby how many it takes
"""

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import LATENT
from wayfarer.world.rows import Flags, Float, Index

Seeds = NDArray[np.uint64]

REMEMBERED: Final = 4096
"""Agents whose manner is kept."""

STRIDE: Final = (-0.05, 0.11)
"""Range over agents of the share by which their steps are shorter than the model's at that speed:
people who walk equally fast differ by 4 % in how many steps they take."""

HURRY: Final = (1.6, 2.0)
"""Metres per second between which that share goes to nothing: nobody runs in long steps."""

_REACTION, _MANNER, _STRIDE, _HABITS = range(1, 5)
"""Draws of one seed that do not depend on each other."""

_STEP: Final = 0x9E3779B97F4A7C15


def sets_off(noise_seed: Seeds, chunk: Index, moments: int) -> Flags:
    """Whether agents [A] who stand may set off with this chunk: each with one in `moments`."""
    own = _mixed(noise_seed, _REACTION) % np.uint64(moments)
    found: Flags = (chunk.astype(np.uint64) + own) % np.uint64(moments) == 0
    return found


def manner(noise_seed: Seeds) -> Float:
    """Latents [A, 128] ~ N(0, I), one of each agent for ever."""
    if not len(noise_seed):
        return np.zeros((0, LATENT), np.float32)
    found = np.concatenate([_manner(seed) for seed in noise_seed.tolist()])
    return found.reshape(-1, LATENT)  # `np.stack` looks at each of them


@lru_cache(REMEMBERED)
def _manner(noise_seed: int) -> Float:
    bits = np.random.Philox(key=np.array([noise_seed, _MANNER], np.uint64))
    return np.random.Generator(bits).standard_normal(LATENT, dtype=np.float32)


def stride(noise_seed: Seeds, speed: Float) -> Float:
    """Shares [A] by which the steps of agents are shorter who are to go at `speed` [A], m/s."""
    (low, high), (slow, fast) = STRIDE, HURRY
    calm = np.clip((fast - speed) / (fast - slow), 0, 1)
    found: Float = ((low + (high - low) * _share(noise_seed, _STRIDE)) * calm).astype(np.float32)
    return found


def draws(noise_seed: Seeds, count: int) -> list[Float]:
    """Numbers of each agent, 0 … 1, that its posture follows from."""
    return [_share(noise_seed, _HABITS + number) for number in range(count)]


def _share(noise_seed: Seeds, draw: int) -> Float:
    """A number of each seed, 0 … 1."""
    return (_mixed(noise_seed, draw) >> np.uint64(40)).astype(np.float32) / np.float32(2**24)


def _mixed(noise_seed: Seeds, draw: int) -> Seeds:
    """64 bits of each seed, spread evenly (the finaliser of SplitMix64)."""
    bits = noise_seed + np.uint64(draw * _STEP % 2**64)
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))
