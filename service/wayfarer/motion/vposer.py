"""A VPoser v2 of a user's own (Pavlakos et al., CVPR 2019), in place of our pose prior.

Its weights are licensed by the Max Planck Institute and are not shipped; this is a network of the
same shape, written from the paper and the names and shapes in the checkpoint, for weights that the
user brings (`training/vposer.py`). It is for use only: as in the checkpoint's own evaluation mode,
batch normalisation is fixed and nothing drops out.

VPoser's bodies are Y up and face +Z, ours are Z up and face +Y: joints' rotation vectors are turned
from the one basis to the other by (x, y, z) → (-x, z, y), which undoes itself.
"""

import torch
from torch import Tensor, nn

from wayfarer.motion.pose_prior import JOINTS, LATENT
from wayfarer.motion.predictor import Posterior
from wayfarer.motion.rotation import matrix_from_6d, rotvec_from_matrix


class VPoser(nn.Module):
    """Same interface as `PosePrior`; meant for SMPL-X bodies, whose joints it was trained on."""

    basis: Tensor

    def __init__(self, neurons: int) -> None:
        super().__init__()
        self.encoder = nn.Sequential(
            nn.BatchNorm1d(3 * JOINTS),
            nn.Linear(3 * JOINTS, neurons),
            nn.LeakyReLU(),
            nn.BatchNorm1d(neurons),
            nn.Linear(neurons, neurons),
            nn.Linear(neurons, neurons),
        )
        self.mean = nn.Linear(neurons, LATENT)
        self.spread = nn.Linear(neurons, LATENT)
        self.decoder = nn.Sequential(
            nn.Linear(LATENT, neurons),
            nn.LeakyReLU(),
            nn.Linear(neurons, neurons),
            nn.LeakyReLU(),
            nn.Linear(neurons, 6 * JOINTS),
        )
        basis = torch.tensor([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
        self.register_buffer("basis", basis, persistent=False)

    def encode(self, rotations: Tensor) -> Posterior:
        """Local rotations [..., 21, 3, 3] → where in the latent space the pose lies [..., 32]."""
        rotvecs = (rotvec_from_matrix(rotations) @ self.basis).flatten(-2)
        features = self.encoder(rotvecs.flatten(0, -2)).unflatten(0, rotvecs.shape[:-1])
        deviation = nn.functional.softplus(self.spread(features))
        return Posterior(self.mean(features), 2 * torch.log(deviation))

    def decode(self, latent: Tensor) -> Tensor:
        """Latents [..., 32] → local rotations [..., 21, 3, 3]."""
        # its 6D form lists the two columns entry by entry: a₀ b₀ a₁ b₁ a₂ b₂
        columns = self.decoder(latent).unflatten(-1, (JOINTS, 3, 2)).transpose(-1, -2)
        return self.basis @ matrix_from_6d(columns.flatten(-2)) @ self.basis
