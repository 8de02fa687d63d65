"""The service's foot lock (`wayfarer.world.output.footlock`) for crowds in training."""

import numpy as np
import torch
from torch import Tensor

from wayfarer.body.model import BodyModel
from wayfarer.motion.primitive import Settled
from wayfarer.world.output.footlock import Planted, leg_shares, lock_feet
from wayfarer.world.output.legs import Legs, measure_legs
from wayfarer_lab.training.crowd import TrainingCrowd


class TrainingFootLock:
    """Locks the feet of bodies of one gender. Legs of shapes are measured once."""

    def __init__(self, body: BodyModel) -> None:
        self.body = body
        self.shares = leg_shares(body.marker_names)
        self._known: dict[bytes, Legs] = {}

    def apply(self, before: TrainingCrowd, made: Settled) -> Settled:
        """The crowd's step after the service's foot lock. It has no gradient."""
        hips, turns = (_array(v) for v in (before.translation, before.rotations))
        step = Planted(
            _array(made.rotations),
            _array(made.next_seed_markers),
            np.zeros((*made.translation.shape[:2], 2), np.bool_),
        )
        locked = lock_feet(
            np.ones(len(hips), np.bool_),
            self._legs(before.betas),
            self.shares,
            (hips, turns),
            _array(made.translation),
            step,
        )
        return made._replace(
            rotations=torch.from_numpy(locked.rotations),
            next_seed_markers=torch.from_numpy(locked.markers),
        )

    def _legs(self, betas: Tensor) -> Legs:
        shapes = [row.tobytes() for row in _array(betas)]
        known = {
            shape: self._known.get(shape) or measure_legs(self.body, np.frombuffer(shape, "f4"))
            for shape in shapes
        }
        self._known = known  # shapes of agents that have left are forgotten
        return Legs.join([known[shape] for shape in shapes])


def _array(values: Tensor) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    return values.detach().float().numpy()
