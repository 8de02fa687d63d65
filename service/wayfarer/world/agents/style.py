"""An agent's individual style: agents with the same command do not move alike.

Everything follows from the noise seed, so the same seed gives the same motion.

    reaction   a standing agent sets off at its own one of several moments, 0.2 s apart; this
               needs no memory of when the command came, and repeated commands do not delay it
    own noise  a part of the noise of each of its steps
    manner     an input of its policy, which may heed it or not
"""

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import LATENT, MANNER
from wayfarer.world.rows import Flags, Float, Index, Rows, Shape

Seeds = NDArray[np.uint64]

_REACTION, _OWN, _MANNER = range(1, 4)
"""Independent draws from one seed."""

_STEP: Final = 0x9E3779B97F4A7C15


@dataclass(slots=True)
class Style(Rows):
    """What agents draw once, ~ N(0, I)."""

    own_noise: Annotated[Float, Shape(LATENT)]
    manner: Annotated[Float, Shape(MANNER)]


def sets_off(noise_seed: Seeds, chunk: Index, moments: int) -> Flags:
    """Whether standing agents [A] may set off with this chunk: each with one in `moments`."""
    own = _mixed(noise_seed, _REACTION) % np.uint64(moments)
    found: Flags = (chunk.astype(np.uint64) + own) % np.uint64(moments) == 0
    return found


def style_of(noise_seed: Seeds) -> Style:
    """The styles of agents [A]."""
    found = Style.empty(len(noise_seed))
    for row, seed in enumerate(noise_seed.tolist()):
        for draw, values in ((_OWN, found.own_noise), (_MANNER, found.manner)):
            bits = np.random.Philox(key=np.array([seed, draw], np.uint64))
            np.random.Generator(bits).standard_normal(out=values[row], dtype=np.float32)
    return found


def _mixed(noise_seed: Seeds, draw: int) -> Seeds:
    """64 bits of each seed, spread evenly (the finaliser of SplitMix64)."""
    bits = noise_seed + np.uint64(draw * _STEP % 2**64)
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))
