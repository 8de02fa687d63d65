"""Latent noise that depends on the agent alone.

Philox is a counter-based generator: the key is the agent's noise seed, the counter the number
of its chunk. So an agent's noise does not depend on which batch, tick or machine steps it, and
a run can be repeated, or resumed in its middle, from the seed.
"""

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import LATENT

_STREAM = 0x5741594641524552  # second half of the key: keeps our draws apart from others'


def latents(
    noise_seed: NDArray[np.uint64], chunk: NDArray[np.int64], candidates: int
) -> NDArray[np.float32]:
    """Standard normal candidates [A, K, 128] for chunk `chunk` [A] of agents `noise_seed` [A].

    The first K candidates are the same for every larger K.
    """
    noise = np.empty((len(noise_seed), candidates, LATENT), np.float32)
    bits = np.random.Philox(key=0)
    generator = np.random.Generator(bits)
    state = bits.state  # set for each row, which costs a third of making a generator
    key, counter = state["state"]["key"], state["state"]["counter"]
    key[1] = _STREAM
    for row, seed, number in zip(noise, noise_seed.tolist(), chunk.tolist(), strict=True):
        key[0] = seed
        counter[1] = number  # word 0 counts the draws within the chunk
        bits.state = state
        generator.standard_normal(dtype=np.float32, out=row)
    return noise
