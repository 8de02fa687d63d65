"""A policy as the driver of a bare model: one draw of it for each step."""

from dataclasses import dataclass, field

import torch
from torch import Tensor

from wayfarer.motion.frame import canonical_frame, to_local
from wayfarer.motion.policy import TrajectoryPolicy
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.motion.trajectory import Asked
from wayfarer_lab.training.rotation import matrix_from_quaternion


@dataclass
class Led:
    """A `bare.BareStep`: the latent is drawn from a policy that is asked for ways and facings.

    `temperature` scales the noise of the draw: 1 as the policy was cloned, 0 its mean.
    """

    step: PrimitiveStep
    policy: TrajectoryPolicy
    temperature: float = 1.0
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
        answer = self.policy.lead(seed.flatten(2), Asked(ways, facings))
        noise = torch.randn(answer.mean.shape, generator=self.random)
        latent = answer.mean + self.temperature * torch.exp(answer.log_std) * noise
        future = self.step.predictor.decode(seed.flatten(2), latent[:, None])[:, 0]
        settled = self.step.follow(seed_markers, seed_translation, seed_rotations, betas, future)
        return settled.translation, settled.rotations, settled.next_seed_markers
