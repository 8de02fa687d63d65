"""The pose prior as ONNX graphs: an encoder and a decoder of poses."""

import torch
from torch import Tensor, nn

from wayfarer.motion.predictor import Posterior
from wayfarer_lab.training.graphs import ExportGraph
from wayfarer_lab.training.pose_networks import JOINTS, LATENT, PosePrior
from wayfarer_lab.training.rotation import matrix_from_rotvec


class _Encode(nn.Module):
    def __init__(self, prior: PosePrior) -> None:
        super().__init__()
        self.prior = prior

    def forward(self, rotations: Tensor) -> tuple[Tensor, Tensor]:
        """As the prior's `encode`."""
        return self.prior.encode(rotations)


class _Decode(nn.Module):
    def __init__(self, prior: PosePrior) -> None:
        super().__init__()
        self.prior = prior

    def forward(self, latent: Tensor) -> Tensor:
        """As the prior's `decode`."""
        return self.prior.decode(latent)


def pose_encoder_graph(prior: PosePrior) -> ExportGraph:
    """Local rotations [N, 21, 3, 3] → mean and log_variance [N, 32] of their latents."""
    rotations = matrix_from_rotvec(torch.randn(3, JOINTS, 3) * 0.3)
    return ExportGraph(
        _Encode(prior), {"rotations": rotations}, Posterior._fields, {"rotations": ("rows",)}
    )


def pose_decoder_graph(prior: PosePrior) -> ExportGraph:
    """Latents [N, 32], N(0, I) for poses of people → local rotations [N, 21, 3, 3]."""
    inputs = {"latent": torch.randn(3, LATENT)}
    return ExportGraph(_Decode(prior), inputs, ("rotations",), {"latent": ("rows",)})
