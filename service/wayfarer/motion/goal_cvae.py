"""The paper's baseline of motion control, *g-CVAE* (Sec. 4.2): the goal as a further condition of
the generative model itself, in place of a policy over its latents.

Condition: the state of Eq. 3, that is the seed and for each of its markers the direction to the
goal. All else is the marker predictor's.
"""

import torch
from torch import Tensor

from wayfarer.motion.layers import Gru
from wayfarer.motion.policy import Condition, state
from wayfarer.motion.predictor import HIDDEN, SIZE, MarkerPredictor
from wayfarer.motion.primitive import PrimitiveStep


class GoalCvae(MarkerPredictor):
    """A marker predictor whose seeds are states [..., S, 402]."""

    def __init__(self, seed_frames: int) -> None:
        super().__init__(seed_frames)
        self.seed_encoder = Gru(2 * SIZE, HIDDEN)

    def start_from(self, predictor: MarkerPredictor) -> None:
        """Take over a predictor's weights: at first, the goal is not looked at."""
        weights = predictor.state_dict()
        known = weights["seed_encoder.from_input.weight"]
        weights["seed_encoder.from_input.weight"] = torch.cat([known, torch.zeros_like(known)], 1)
        self.load_state_dict(weights)


class GoalCvaeStep(PrimitiveStep):
    """A step whose predictor is a `GoalCvae`: latents come from the prior N(0, I)."""

    def predict(self, seed: Tensor, asked: Condition, noise: Tensor, share: Tensor) -> Tensor:
        """As `PrimitiveStep.predict`; `share` means nothing here."""
        return self.predictor.decode(state(seed, asked.goal), noise)
