"""Present motion of agents, from their last frames."""

from typing import Final

import numpy as np

from wayfarer.world.rows import Float

FORESIGHT: Final = 0.4
"""Maximum seconds for which a place is extrapolated."""

SLOW: Final = 0.15
"""m/s: below this, hips only sway."""


def moving(hips: Float, speed: Float) -> Float:
    """Velocities [A, 2] of agents, from their last frames, hips [A, S, 3], and the `speed` [A] of
    their gait.
    """
    way = hips[:, -1, :2] - hips[:, 0, :2]
    length = np.maximum(np.linalg.norm(way, axis=-1), 1e-6)
    steady = np.where(speed < SLOW, 0.0, speed)
    found: Float = (way * (steady / length)[:, None]).astype(np.float32)
    return found
