"""The paper's networks where ours differ in form: body regressor and policy of GAMMA-release.

Written from the layout of its public code (Apache 2.0); nothing of it is copied. The marker
predictor needs no separate network: `MarkerPredictor` with a prior of N(0, I) is the same
function.
"""

import torch
from torch import Tensor, nn

from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.motion.constants import constant, indices
from wayfarer.motion.layers import Gru, ResidualBlock
from wayfarer.motion.marker_body import Shaped
from wayfarer.motion.policy import Condition, Gaussian, LeakyBlock, state
from wayfarer.motion.posing import compose, from_6d, to_columns, to_rows
from wayfarer.motion.regressor import Pose
from wayfarer.spec import BETAS, LATENT, MARKERS, POSED_JOINTS

PARAMETERS = 3 + POSED_JOINTS * 6 + 24
"""Body parameters of the regressor: place, 6D rotations, 12 PCA coefficients per hand."""

PASSES = 3

LOG_VARIANCE = (-2.5, 2.5)
"""Limits of log σ² of the policy (its MPVAEPolicy_v0.yml)."""

SIXD = (0, 2, 4, 1, 3, 5)
"""Their 6D numbers are a 3 × 2 matrix row by row; ours are its columns, one after the other."""


class GammaPolicy(nn.Module):
    """π(Z | s) of Fig. S4: the state of Eq. 3 and nothing else. Serves 1- and 2-frame seeds."""

    def __init__(self, hidden: int, blocks: int) -> None:
        super().__init__()
        self.encoder = Gru(2 * MARKERS * 3, hidden)
        self.actor = nn.Sequential(*(LeakyBlock(hidden) for _ in range(blocks)))
        self.output = nn.Linear(hidden, 2 * LATENT)

    def forward(self, seed: Tensor, condition: Condition) -> Gaussian:
        """Seed [A, S, 201], canonical frame → the distribution of latents [A, 128].

        Only the goal of a condition counts: these weights know no speed and no facing.
        """
        encoded = self.encoder.encode(state(seed, condition.goal))
        mean, log_variance = self.output(self.actor(encoded)).chunk(2, -1)
        return Gaussian(mean, 0.5 * log_variance.clamp(*LOG_VARIANCE))


class GammaRegressor(nn.Module):
    """The paper's body regressor (Sec. 3.2.1): markers and the last estimate → a correction.

    Differs from `BodyRegressor`: it never sees the markers of its estimate, begins at zeros, and
    has parameters of SMPL-X, in the frame of its files (`body/smplx.py`), with a `transl` that
    moves the mesh: hips = transl + root joint of the shape.
    """

    root: Tensor
    root_dirs: Tensor

    def __init__(
        self, root: Tensor, root_dirs: Tensor, hidden: int, blocks: int, passes: int = PASSES
    ) -> None:
        """The root joint of shapes, in the file's axes: mean [3] and by coefficient [3, 10]."""
        super().__init__()
        self.passes = passes
        self.network = nn.Sequential(
            nn.Linear(MARKERS * 3 + PARAMETERS + BETAS, hidden),
            *(ResidualBlock(hidden) for _ in range(blocks)),
            nn.Linear(hidden, PARAMETERS),
        )
        self.register_buffer("root", root.float(), persistent=False)
        self.register_buffer("root_dirs", root_dirs.float(), persistent=False)

    def forward(self, markers: Tensor, betas: Tensor) -> tuple[Tensor, Tensor]:
        """Hips [A, F, 3], rotations [A, F, 22, 3, 3] of markers [A, F, 67, 3], betas [A, 10]."""
        found = self.solve(markers, betas)
        return to_rows(found.hips.transpose(0, 1)), to_rows(found.rotations.permute(3, 2, 0, 1, 4))

    def solve(self, markers: Tensor, betas: Tensor, shape: Shaped | None = None) -> Pose:
        """As `forward`, poses last; needs no `shape`, which `BodyRegressor` skins with."""
        agents, frames = markers.shape[:2]
        given = markers.flatten(2).flatten(0, 1)  # [A · F, 201]
        shapes = betas[:, None].expand(-1, frames, -1).flatten(0, 1)
        state = torch.zeros_like(given[:, :1]).expand(-1, PARAMETERS)
        for _ in range(self.passes):
            state = state + self.network(torch.cat([given, state, shapes], -1))
        numbers = to_columns(state.unflatten(0, (agents, frames))).transpose(0, 1)  # [159, F, A]
        sixd = numbers[3 : 3 + POSED_JOINTS * 6].unflatten(0, (POSED_JOINTS, 6))
        turns = from_6d(sixd.index_select(1, indices(SIXD, sixd)).transpose(0, 1))
        axes = constant(turns, _axes, turns.dtype)[:, :, None, None, None]
        ours = compose(turns, axes.expand_as(turns[:, :, :1]))
        rotations = torch.cat([ours[:, :, :1], compose(axes, ours[:, :, 1:])], 2)
        root = self.root + (self.root_dirs * betas[:, None]).sum(-1)  # [A, 3]
        return Pose(numbers[:3] + root.T[:, None], rotations)


def _axes(dtype: torch.dtype) -> Tensor:
    """File axes to ours, its own inverse [3, 3]: p_ours = A p_file, R_ours = A R_file A."""
    return torch.tensor(GLTF_FROM_CORE.tolist(), dtype=dtype)
