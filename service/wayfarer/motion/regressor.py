"""The body regressor: body parameters from markers, frame by frame (paper Sec. 3.2.1, Fig. 2).

Residual blocks applied three times over, each pass correcting the last (as in HMR). Rotations are
6D inside and matrices at the output. One network per gender.

Deviations from the paper, and why: markers are centred on their mean (the hips' place is found
relative to it), so that neither the floor nor the travelled way matters; the first estimate is
the identity pose rather than zeros, which 6D cannot orthonormalise; fingers are held at rest, so
the hand term of Eq. 2 has nothing to act on with the default body.
"""

import torch
from torch import Tensor, nn

from wayfarer.motion.layers import ResidualBlock
from wayfarer.motion.rotation import matrix_from_6d
from wayfarer.spec import BETAS, MARKERS, POSED_JOINTS

STATE = 3 + POSED_JOINTS * 6
HIDDEN = 128
BLOCKS = 10
RECURSIONS = 3


class BodyRegressor(nn.Module):
    """Finds the hips' place and 22 local rotations."""

    start: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.input = nn.Linear(MARKERS * 3 + STATE + BETAS, HIDDEN)
        self.blocks = nn.Sequential(*(ResidualBlock(HIDDEN) for _ in range(BLOCKS)))
        self.output = nn.Linear(HIDDEN, STATE)
        identity = torch.tensor([1.0, 0, 0, 0, 1, 0]).repeat(POSED_JOINTS)
        self.register_buffer("start", torch.cat([torch.zeros(3), identity]), persistent=False)
        nn.init.normal_(self.output.weight, std=1e-3)
        nn.init.zeros_(self.output.bias)

    def forward(self, markers: Tensor, betas: Tensor) -> tuple[Tensor, Tensor]:
        """Markers [..., 67, 3], betas [..., 10] → hips [..., 3], rotations [..., 22, 3, 3]."""
        centre = markers.mean(-2)
        given = torch.cat([(markers - centre[..., None, :]).flatten(-2), betas], -1)
        state = self.start.expand(*given.shape[:-1], STATE)
        for _ in range(RECURSIONS):
            features = self.input(torch.cat([given, state], -1))
            state = state + self.output(self.blocks(features))
        rotations = matrix_from_6d(state[..., 3:].unflatten(-1, (POSED_JOINTS, 6)))
        return centre + state[..., :3], rotations
