"""The service's foot lock (`wayfarer.world.output.footlock`) for bodies in training."""

from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from wayfarer.body.model import BodyModel
from wayfarer.motion.primitive import Settled
from wayfarer.world.output.footlock import Planted, leg_shares, lock_feet
from wayfarer.world.output.legs import Legs, measure_legs

REMEMBERED = 4096
"""Shapes whose legs are kept."""


class TrainingFootLock:
    """Locks the feet of bodies of one gender. Legs of a shape are measured once."""

    def __init__(self, body: BodyModel) -> None:
        self.shares = leg_shares(body.marker_names)

        @lru_cache(REMEMBERED)
        def legs(shape: bytes) -> Legs:
            return measure_legs(body, np.frombuffer(shape, np.float32))

        self._legs = legs

    def apply(self, hips: Tensor, rotations: Tensor, betas: Tensor, made: Settled) -> Settled:
        """The step that bodies [A] made, after the service's foot lock. It has no gradient.

        hips [A, S, 3] and rotations [A, S, 22, 4] are of the seed, world space; betas [A, 10].
        """
        step = Planted(
            _array(made.rotations),
            _array(made.next_seed_markers),
            np.zeros((*made.translation.shape[:2], 2), np.bool_),
        )
        locked = lock_feet(
            np.ones(len(hips), np.bool_),
            Legs.join([self._legs(row.tobytes()) for row in _array(betas)]),
            self.shares,
            (_array(hips), _array(rotations)),
            _array(made.translation),
            step,
        )
        return made._replace(
            rotations=torch.from_numpy(locked.rotations),
            next_seed_markers=torch.from_numpy(locked.markers),
        )


def _array(values: Tensor) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    return values.detach().float().numpy()
