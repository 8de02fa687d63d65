"""The marker predictor: a CVAE over motion primitives (paper Sec. 3.2.1, Fig. 2, left).

Condition: the motion seed X (1 or 2 frames). Encoder (training only): q(Z | X, Y). Decoder:
future frames Y from X and z, each the last known one plus a predicted change.

Deviation from the paper: the decoder may find several frames at once, `at_once`, which is cheaper.

Deviation from the paper: the prior is learned, p(Z | X) = N(μ(X), σ(X)) (as in HuMoR), because a
posterior that a weak KL term leaves free is not distributed as N(0, I). Latents are relative to it:
a latent z of this module stands for μ(X) + σ(X) ⊙ z. A draw z ~ N(0, I) is then a draw from the
learned prior, and KL(· ‖ N(0, I)) is the divergence from it.
"""

from collections.abc import Mapping
from typing import NamedTuple, Self

import torch
from torch import Tensor, nn

from wayfarer.errors import ArtifactError
from wayfarer.motion.layers import Gru, Mlp
from wayfarer.spec import LATENT, MARKERS, PRIMITIVE_FRAMES

SIZE = MARKERS * 3
HIDDEN = 256


LOG_STD = (-5.0, 3.0)
"""Limits of log σ of the prior."""


class Posterior(NamedTuple):
    """Diagonal Gaussian q(Z | X, Y), relative to the prior p(Z | X); both [..., 128]."""

    mean: Tensor
    log_variance: Tensor

    def sample(self) -> Tensor:
        """One latent per row, by reparametrisation."""
        return self.mean + torch.randn_like(self.mean) * torch.exp(0.5 * self.log_variance)

    def kl(self) -> Tensor:
        """KL(q ‖ p) averaged over latent dimensions. [...]"""
        variance = torch.exp(self.log_variance)
        return 0.5 * (variance + self.mean**2 - 1 - self.log_variance).mean(-1)


class MarkerPredictor(nn.Module):
    """Frames are flat markers [201] in metres, canonical frame; or `size` other numbers."""

    def __init__(self, seed_frames: int, size: int = SIZE, at_once: int = 1) -> None:
        """`at_once`: frames per step of the decoder; 1, as in the paper, is one by one."""
        super().__init__()
        self.size = size
        self.seed_frames = seed_frames
        self.new_frames = PRIMITIVE_FRAMES - seed_frames
        if self.new_frames % at_once:
            raise ValueError(f"{self.new_frames} frames are no multiple of {at_once}")
        self.at_once = at_once
        self.seed_encoder = Gru(size, HIDDEN)
        self.future_encoder = Gru(size, HIDDEN)
        self.posterior = Mlp([2 * HIDDEN, 512, HIDDEN])
        self.mean = nn.Linear(HIDDEN, LATENT)
        self.log_variance = nn.Linear(HIDDEN, LATENT)
        expected = nn.Linear(HIDDEN, 2 * LATENT)
        nn.init.zeros_(expected.weight)  # begins as N(0, I)
        nn.init.zeros_(expected.bias)
        self.prior = nn.Sequential(Mlp([HIDDEN, HIDDEN]), expected)
        self.uses_prior = True
        self.first_state = Mlp([HIDDEN, 512, HIDDEN, HIDDEN])
        self.decoder = Gru(size, HIDDEN)
        self.from_seed = nn.Linear(HIDDEN, 3 * HIDDEN, bias=False)
        self.from_latent = nn.Linear(LATENT, 3 * HIDDEN, bias=False)
        self.output = nn.Sequential(Mlp([HIDDEN, 512, HIDDEN]), nn.Linear(HIDDEN, at_once * size))

    @classmethod
    def fitting(cls, weights: Mapping[str, Tensor], seed_frames: int) -> Self:
        """A new predictor with the sizes of these weights. Raises ArtifactError for others."""
        try:
            size = weights["decoder.from_input.weight"].shape[1]
            rows = len(weights["output.1.bias"])
        except KeyError as error:
            raise ArtifactError(f"these are no weights of a predictor: no {error}") from None
        return cls(seed_frames, size, rows // size)

    @property
    def has_learned_prior(self) -> bool:
        """Whether the prior differs from N(0, I); otherwise `uses_prior` may be false."""
        return any(bool(parameter.any()) for parameter in self.prior[-1].parameters())

    def expected(self, hx: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and log σ [..., 128] of p(Z | X) from an encoded seed [..., 256]."""
        mean, log_std = self.prior(hx).float().chunk(2, -1)
        low, high = LOG_STD
        return mean, log_std.clamp(low, high)

    def encode(self, seed: Tensor, future: Tensor) -> Posterior:
        """Seed [..., S, size or more], future [..., F, size] → posterior."""
        hx = self.seed_encoder.encode(seed)
        features = self.posterior(torch.cat([hx, self.future_encoder.encode(future)], -1))
        mean, log_std = self.expected(hx)
        return Posterior(
            (self.mean(features).float() - mean) * torch.exp(-log_std),
            self.log_variance(features).float() - 2 * log_std,
        )

    def decode(self, seed: Tensor, latent: Tensor) -> Tensor:
        """Seed [A, S, 201], latent [A, K, 128] → future [A, K, F, 201].

        The part that depends only on the seed is computed once for all K candidates. Numbers of a
        seed's frame beyond its 201 are a condition (`goal_cvae.py`).
        """
        agents, candidates = latent.shape[:2]
        hx = self.seed_encoder.encode(seed)
        if self.uses_prior:
            mean, log_std = self.expected(hx)
            latent = mean[:, None] + torch.exp(log_std)[:, None] * latent

        def for_all(x: Tensor) -> Tensor:  # [A, N] → [A · K, N]
            return x[:, None].expand(-1, candidates, -1).flatten(0, 1)

        # Two axes only: exporters then make one operator of a product and its bias.
        condition = for_all(self.from_seed(hx)) + self.from_latent(latent.flatten(0, 1))
        fixed = self.decoder.fixed(condition)
        state, frame = for_all(self.first_state(hx)), for_all(seed[:, -1, : self.size])
        frames = []
        for _ in range(0, self.new_frames, self.at_once):
            state = self.decoder.step(frame, fixed, state)
            changes = self.output(state).unflatten(-1, (self.at_once, self.size))
            found = frame[:, None] + changes
            frames.append(found)
            frame = found[:, -1]
        return torch.cat(frames, -2).unflatten(0, (agents, candidates))
