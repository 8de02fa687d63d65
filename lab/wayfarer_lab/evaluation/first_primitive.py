"""The first primitive of a body, as the paper has it: by the 1-frame predictor, from a still pose.

A policy that was trained so has never seen a body that has been at rest for two frames.
"""

from collections.abc import Sequence

import numpy as np
import torch

from wayfarer.errors import InvalidArgument
from wayfarer.spec import GENDERS, LATENT, SEED_FRAMES
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.slots import Motion
from wayfarer_lab.evaluation.model_parts import Parts, Variant
from wayfarer_lab.evaluation.rollout import FrozenPoses, Seed, advance
from wayfarer_lab.training.rotation import matrix_from_quaternion


class Lead:
    """Moves standing bodies on by a primitive of the 1-frame predictor, latents from N(0, I)."""

    def __init__(self, parts: Parts, seed: int) -> None:
        """Raises InvalidArgument when there is no 1-frame predictor."""
        name = next((n for n in ("ro-1f", "1f") if n in parts.predictors), None)
        if name is None:
            raise InvalidArgument("the model holds no 1-frame predictor to begin with", "lead")
        self._steps = {g: parts.step(g, Variant("lead", name)) for g in GENDERS}
        self._random = torch.Generator().manual_seed(seed)

    @torch.inference_mode()
    def __call__(self, specs: Sequence[AgentSpec], motions: Sequence[Motion]) -> None:
        """Changes the motions of `specs` in place: their seeds end the new primitive."""
        for spec, motion in zip(specs, motions, strict=True):
            step = self._steps[spec.gender]
            still = Seed(
                *(
                    torch.from_numpy(np.asarray(part[:, -1:], np.float32))
                    for part in (
                        motion.seed.markers,
                        motion.seed.translation,
                        motion.seed.rotations,
                    )
                )
            )
            betas = torch.tensor([spec.betas], dtype=torch.float32)
            body = FrozenPoses(spec.gender, still.rotations[:, 0], betas)
            noise = torch.randn(1, 1, LATENT, generator=self._random)
            made = advance(step, still, body, noise, None)
            local = matrix_from_quaternion(made.rotations)
            markers, _ = step.body.skin(step.body.shaped(betas), made.translation, local)
            motion.seed.markers[:] = markers[:, -SEED_FRAMES:].numpy()
            motion.seed.translation[:] = made.translation[:, -SEED_FRAMES:].numpy()
            motion.seed.rotations[:] = made.rotations[:, -SEED_FRAMES:].numpy()
            motion.gait.rested[:] = False
