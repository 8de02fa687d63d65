"""A critic that tells made walks from recorded ones, by 1.6 s of steady, straight walking.

No quality term says how people walk: a body that glides on level hips costs least. The critic is a
small network that learns, while the policy trains, to tell windows that the policy makes from
recorded ones at the same speeds. Its verdict is differentiable, so the policy learns from it (the
role of the discriminator of AMP, Peng et al. 2021; losses of LSGAN, Mao et al. 2017, Eq. 9 with
a = -1, b = c = 1; price on the critic's slope at recorded windows: R1 of Mescheder et al. 2018).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor, nn

from wayfarer.spec import FPS

FRAMES = 64
"""Of a window: 1.6 s, nearly three steps."""

NOISE = 0.15
"""Standard deviation of the noise on the critic's normalised features, so that it cannot go by
tenths of a millimetre."""

WAIST = ("LFWT", "LBWT", "RFWT", "RBWT")
LIMBS = (
    (WAIST, ("C7", "CLAV")),  # trunk
    (("C7", "CLAV"), ("LFHD", "LBHD", "RFHD", "RBHD")),  # neck
    (("LBHD", "RBHD"), ("LFHD", "RFHD")),  # the way the head faces
    (("LFWT", "LBWT"), ("RFWT", "RBWT")),  # across the waist
    (("LSHO",), ("RSHO",)),  # across the shoulders
    *(
        (tuple(side + n for n in start), tuple(side + n for n in end))
        for side in "LR"
        for start, end in (
            (("HIP",), ("KNE", "KNI")),
            (("KNE", "KNI"), ("ANK",)),
            (("HEE",), ("MT1", "MT5")),
            (("SHO",), ("ELB", "ELBIN")),
            (("ELB", "ELBIN"), ("IWR", "OWR")),
        )
    ),
)
"""Parts of the body, each from the mean of some markers to the mean of others."""


@dataclass(frozen=True)
class GaitFeatures:
    """Turns windows of markers into what the critic sees. Each column averages some markers."""

    start: Tensor  # [67, P]
    end: Tensor  # [67, P]
    waist: Tensor  # [67]

    @classmethod
    def from_names(cls, names: Sequence[str]) -> "GaitFeatures":
        """For bodies whose markers have these names. Raises KeyError when one is missing."""
        at = {name: i for i, name in enumerate(names)}

        def means(groups: Sequence[Sequence[str]]) -> Tensor:
            found = torch.zeros(len(names), len(groups))
            for column, group in enumerate(groups):
                found[[at[n] for n in group], column] = 1 / len(group)
            return found

        starts, ends = zip(*LIMBS, strict=True)
        return cls(means(starts), means(ends), means([WAIST])[:, 0])

    @property
    def size(self) -> int:
        """Features of a frame."""
        return 6 * self.start.shape[1] + 4

    def of(self, markers: Tensor) -> Tensor:
        """Features [B, size, T - 1] of windows [B, T, 67, 3], metres, Z up.

        Directions of the parts of the body and their rates (1/s), velocity (m/s) of the waist and
        its height over its mean (m). Right, forward and up are those of the window's way, so place
        and heading do not matter, and the shape of the body matters little.
        """
        points = markers.transpose(-1, -2)  # [B, T, 3, 67]
        hips = points @ self.waist  # [B, T, 3]
        way = (hips[:, -1, :2] - hips[:, 0, :2]).detach()
        way = way / way.norm(dim=-1, keepdim=True).clamp(min=1e-6)
        x, y = way[:, :1, None], way[:, 1:, None]

        def along(v: Tensor) -> Tensor:  # [B, T, 3 (world), P] → right, forward, up
            a, b, c = v.unbind(2)
            return torch.stack([a * y - b * x, a * x + b * y, c], 2)

        parts = along(points @ self.end - points @ self.start)
        parts = parts / parts.norm(dim=2, keepdim=True).clamp(min=1e-6)
        rates = (parts[:, 1:] - parts[:, :-1]) * FPS
        travel = along((hips[:, 1:] - hips[:, :-1])[..., None])[..., 0] * FPS
        height = hips[:, 1:, 2:] - hips[..., 2:].mean(1, keepdim=True)
        found = [parts[:, 1:].flatten(2), rates.flatten(2), travel, height]
        return torch.cat(found, -1).transpose(1, 2)

    def speed(self, markers: Tensor) -> Tensor:
        """Mean horizontal speed of the waist [B], m/s, from end to end of windows."""
        hips = markers[:, [0, -1], :, :2].transpose(-1, -2) @ self.waist
        return (hips[:, 1] - hips[:, 0]).norm(dim=-1) * FPS / (markers.shape[1] - 1)


HIDDEN: Final = 96
"""Channels of the critic's hidden layers."""


class Critic(nn.Module):
    """Verdict on windows of steady walking: towards 1 recorded, towards -1 made."""

    mean: Tensor
    scale: Tensor

    def __init__(self, features: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(features, 1))
        self.register_buffer("scale", torch.ones(features, 1))
        self.moves = nn.Sequential(
            nn.Conv1d(features, HIDDEN, 5, 2), nn.LeakyReLU(0.2),
            nn.Conv1d(HIDDEN, HIDDEN, 5, 2), nn.LeakyReLU(0.2),
            nn.Conv1d(HIDDEN, HIDDEN, 3), nn.LeakyReLU(0.2),
        )  # fmt: skip
        self.verdict = nn.Sequential(
            nn.Linear(2 * HIDDEN + 2 * features, 128), nn.LeakyReLU(0.2), nn.Linear(128, 1)
        )

    def fit(self, features: Tensor) -> None:
        """Take the centre and the scale of features from recorded ones [B, C, T]."""
        self.mean = features.mean((0, 2))[:, None]
        self.scale = features.std((0, 2))[:, None] + 1e-3

    def forward(self, features: Tensor) -> Tensor:
        """[B, C, T] → [B]"""
        x = (features - self.mean) / self.scale
        x = x + NOISE * torch.randn_like(x)
        seen = self.moves(x)
        pooled = [moment for v in (seen, x) for moment in (v.mean(-1), (v.var(-1) + 1e-4).sqrt())]
        return self.verdict(torch.cat(pooled, -1)).squeeze(-1)

    def loss(self, recorded: Tensor, made: Tensor) -> tuple[Tensor, dict[str, float]]:
        """What the critic minimises on features [B, C, T] of both kinds, and figures of it.

        Figures: mean verdict on either kind, and the share of pairs that it orders rightly (AUC).
        """
        recorded = recorded.detach().requires_grad_(True)
        yes, no = self(recorded), self(made.detach())
        (slope,) = torch.autograd.grad(yes.sum(), recorded, create_graph=True)
        steepness = (slope * self.scale).square().sum((1, 2)).mean()
        loss = ((yes - 1) ** 2).mean() + ((no + 1) ** 2).mean() + steepness
        return loss, {
            "auc": float((yes[:, None] > no[None]).float().mean()),
            "verdict_recorded": float(yes.detach().mean()),
            "verdict_made": float(no.detach().mean()),
        }
