"""The pose prior: a small VAE of body poses, in the role that VPoser has in the paper (Sec. 3.1).

It says how usual a pose is (reward, Eq. 8; evaluation) and makes up new ones (start poses). A pose
is 21 local joint rotations; the root is left out, so neither place nor heading matter.
"""

import torch
from torch import Tensor, nn

from wayfarer.motion.predictor import Posterior
from wayfarer.motion.rotation import matrix_from_6d, sixd_from_matrix
from wayfarer.spec import POSED_JOINTS

JOINTS = POSED_JOINTS - 1
LATENT = 32
HIDDEN = 256


class PosePrior(nn.Module):
    """Rotations are 6D inside, as their difference from the T-pose, and matrices outside."""

    rest: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.encoder = nn.Sequential(
            nn.Linear(6 * JOINTS, HIDDEN), nn.LeakyReLU(), nn.Linear(HIDDEN, HIDDEN), nn.LeakyReLU()
        )
        self.mean = nn.Linear(HIDDEN, LATENT)
        self.log_variance = nn.Linear(HIDDEN, LATENT)
        self.decoder = nn.Sequential(
            nn.Linear(LATENT, HIDDEN),
            nn.LeakyReLU(),
            nn.Linear(HIDDEN, HIDDEN),
            nn.LeakyReLU(),
            nn.Linear(HIDDEN, 6 * JOINTS),
        )
        self.register_buffer("rest", torch.eye(3)[:, :2].T.flatten(), persistent=False)

    def encode(self, rotations: Tensor) -> Posterior:
        """Local rotations [..., 21, 3, 3] → where in the latent space the pose lies [..., 32]."""
        features = self.encoder((sixd_from_matrix(rotations) - self.rest).flatten(-2))
        return Posterior(self.mean(features), self.log_variance(features))

    def decode(self, latent: Tensor) -> Tensor:
        """Latents [..., 32] → local rotations [..., 21, 3, 3]; N(0, I) gives poses of people."""
        return matrix_from_6d(self.decoder(latent).unflatten(-1, (JOINTS, 6)) + self.rest)
