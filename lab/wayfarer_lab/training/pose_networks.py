"""The pose prior: a small VAE of body poses, in the role that VPoser has in the paper (Sec. 3.1).

It says how usual a pose is (reward, Eq. 8; evaluation) and makes up new ones (start poses). A pose
is 21 local joint rotations; the root is left out, so neither place nor heading matter.
"""

import torch
from torch import Tensor, nn

from wayfarer.motion.predictor import Posterior
from wayfarer.spec import POSED_JOINTS
from wayfarer_lab.training.rotation import matrix_from_6d, rotvec_from_matrix, sixd_from_matrix

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


class VPoser(nn.Module):
    """A VPoser v2 of a user's own (Pavlakos et al., CVPR 2019), in place of `PosePrior`.

    Same interface as `PosePrior`; meant for SMPL-X bodies, whose joints it was trained on. Its
    weights are licensed by the Max Planck Institute and are not shipped; this is a network of the
    same shape, written from the paper and the names and shapes in the checkpoint, for weights that
    the user brings (`vposer.py`). It is for use only: as in the checkpoint's own evaluation mode,
    batch normalisation is fixed and nothing drops out.

    VPoser's bodies are Y up and face +Z, ours are Z up and face +Y: joints' rotation vectors are
    turned from the one basis to the other by (x, y, z) → (-x, z, y), which is its own inverse.
    """

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
