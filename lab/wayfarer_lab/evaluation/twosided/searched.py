"""The simplest driver of a bare model: the best of K latents from the prior."""

from dataclasses import dataclass, field
from typing import Final

import torch
from torch import Tensor

from wayfarer.motion.frame import canonical_frame, to_local
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.spec import LATENT, MARKERS
from wayfarer_lab.training.rotation import matrix_from_quaternion

CANDIDATES: Final = 64
METRES_PER_RADIAN: Final = 0.25
"""How much an error of facing counts beside one of place."""


@dataclass
class Searched:
    """A `bare.BareStep`: of `candidates` draws from N(0, I), that whose place and facing after .2 s
    come nearest to what is wished, as the waist's markers tell.
    """

    step: PrimitiveStep
    candidates: int = CANDIDATES
    random: torch.Generator = field(default_factory=lambda: torch.Generator().manual_seed(0))

    def __call__(
        self,
        seed_markers: Tensor,
        seed_translation: Tensor,
        seed_rotations: Tensor,
        betas: Tensor,
        ways: Tensor,
        facings: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """See `bare.BareStep`."""
        turned = matrix_from_quaternion(seed_rotations[:, 0, 0])
        frame = canonical_frame(seed_translation[:, 0], turned, self.step.floor_origin)
        seed = to_local(frame, seed_markers.flatten(1, 2)).unflatten(1, seed_markers.shape[1:3])
        noise = torch.randn(len(betas), self.candidates, LATENT, generator=self.random)
        futures = self.step.predictor.decode(seed.flatten(2), noise)  # [A, K, F, 201]
        place, facing = self._waist(futures[:, :, -1].unflatten(-1, (MARKERS, 3)))
        start, _ = self._waist(seed[:, None, -1])
        away = (place - start - ways[:, :1]).norm(dim=-1)
        off = torch.acos((facing * facings[:, :1]).sum(-1).clamp(-1, 1))
        best = (away + METRES_PER_RADIAN * off).argmin(-1)
        chosen = futures[torch.arange(len(betas)), best]
        settled = self.step.follow(seed_markers, seed_translation, seed_rotations, betas, chosen)
        return settled.translation, settled.rotations, settled.next_seed_markers

    def _waist(self, markers: Tensor) -> tuple[Tensor, Tensor]:
        """Horizontal middle of the waist, and the unit vector that it faces; both [..., 2]."""
        sites = self.step.sites
        left, right = (
            markers[..., side, :2].mean(-2) for side in (sites.left_waist, sites.right_waist)
        )
        across = (right - left) / (right - left).norm(dim=-1, keepdim=True)
        return (left + right) / 2, torch.stack([-across[..., 1], across[..., 0]], -1)
