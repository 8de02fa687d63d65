"""Drivers of a bare model: one draw of a policy for each step, or the best of some of the prior."""

from collections.abc import Callable
from typing import Final

import torch
from torch import Tensor

from wayfarer.motion.frame import canonical_frame, to_local
from wayfarer.motion.policy import TrajectoryPolicy
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.motion.trajectory import Asked
from wayfarer.spec import LATENT, MANNER, MARKERS
from wayfarer_lab.evaluation.twosided.bare import BareStep
from wayfarer_lab.training.rotation import matrix_from_quaternion

CANDIDATES: Final = 64
METRES_PER_RADIAN: Final = 0.25
"""How much an error of facing counts beside one of place."""

Choose = Callable[[Tensor, Tensor, Tensor], Tensor]
"""Seeds [A, 2, 67, 3], ways and facings [A, 3, 2], canonical frame → markers [A, F, 201]."""


def led(
    step: PrimitiveStep, policy: TrajectoryPolicy, random: torch.Generator, temperature: float = 1.0
) -> BareStep:
    """Draws latents from a policy that is asked for ways and facings. All have the mean manner.

    `temperature` scales the noise of the draw: 1 as the policy was cloned, 0 its mean.
    """

    def choose(seed: Tensor, ways: Tensor, facings: Tensor) -> Tensor:
        manner = torch.zeros(len(seed), MANNER)
        answer = policy.lead(seed.flatten(2), Asked(ways, facings), manner)
        noise = torch.randn(answer.mean.shape, generator=random)
        latent = answer.mean + temperature * torch.exp(answer.log_std) * noise
        return step.predictor.decode(seed.flatten(2), latent[:, None])[:, 0]

    return _driven(step, choose)


def searched(
    step: PrimitiveStep, random: torch.Generator, candidates: int = CANDIDATES
) -> BareStep:
    """The draw, of `candidates` from N(0, I), whose place and facing after .2 s come nearest to the
    wish, by the waist's markers.
    """

    def choose(seed: Tensor, ways: Tensor, facings: Tensor) -> Tensor:
        noise = torch.randn(len(seed), candidates, LATENT, generator=random)
        futures = step.predictor.decode(seed.flatten(2), noise)  # [A, K, F, 201]
        place, facing = _waist(step, futures[:, :, -1].unflatten(-1, (MARKERS, 3)))
        start, _ = _waist(step, seed[:, None, -1])
        away = (place - start - ways[:, :1]).norm(dim=-1)
        off = torch.acos((facing * facings[:, :1]).sum(-1).clamp(-1, 1))
        best = (away + METRES_PER_RADIAN * off).argmin(-1)
        return futures[torch.arange(len(seed)), best]

    return _driven(step, choose)


def _driven(step: PrimitiveStep, choose: Choose) -> BareStep:
    def move(
        seed_markers: Tensor,
        seed_translation: Tensor,
        seed_rotations: Tensor,
        betas: Tensor,
        ways: Tensor,
        facings: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor]:
        turned = matrix_from_quaternion(seed_rotations[:, 0, 0])
        frame = canonical_frame(seed_translation[:, 0], turned, step.floor_origin)
        seed = to_local(frame, seed_markers.flatten(1, 2)).unflatten(1, seed_markers.shape[1:3])
        future = choose(seed, ways, facings)
        settled = step.follow(seed_markers, seed_translation, seed_rotations, betas, future)
        return settled.translation, settled.rotations, settled.next_seed_markers

    return move


def _waist(step: PrimitiveStep, markers: Tensor) -> tuple[Tensor, Tensor]:
    """Horizontal middle of the waist, and the unit vector that it faces; both [..., 2]."""
    left, right = (
        markers[..., side, :2].mean(-2) for side in (step.sites.left_waist, step.sites.right_waist)
    )
    across = (right - left) / (right - left).norm(dim=-1, keepdim=True)
    return (left + right) / 2, torch.stack([-across[..., 1], across[..., 0]], -1)
