"""The body regressor: body parameters from markers, frame by frame (paper Sec. 3.2.1, Fig. 2).

Residual blocks applied three times over, each pass correcting the last (as in HMR). Rotations are
6D inside and matrices at the output. One network per gender.

Deviations from the paper, and why: every pass also sees where the markers of its estimate lie, as
their distance from the given ones; so it learns to correct, not to guess again. Markers are centred
on their mean (the hips' place is found relative to it), so that neither the floor nor the
travelled way matters; the first estimate is the identity pose rather than zeros, which 6D cannot
orthonormalise; fingers are held at rest, so the hand term of Eq. 2 has nothing to act on with the
default body.
"""

import torch
from torch import Tensor, nn

from wayfarer.motion.layers import ResidualBlock
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.rotation import matrix_from_6d, sixd_from_matrix
from wayfarer.spec import BETAS, MARKERS, POSED_JOINTS

STATE = 3 + POSED_JOINTS * 6
HIDDEN = 128
BLOCKS = 10
PASSES = 3


class BodyRegressor(nn.Module):
    """Finds the hips' place and 22 local rotations of `body`'s poses."""

    start: Tensor

    def __init__(self, body: MarkerBody) -> None:
        super().__init__()
        self.body = body
        output = nn.Linear(HIDDEN, STATE)
        nn.init.normal_(output.weight, std=1e-3)
        nn.init.zeros_(output.bias)
        self.network = nn.Sequential(
            nn.Linear(2 * MARKERS * 3 + STATE + BETAS, HIDDEN),
            *(ResidualBlock(HIDDEN) for _ in range(BLOCKS)),
            output,
        )
        identity = torch.tensor([1.0, 0, 0, 0, 1, 0]).repeat(POSED_JOINTS)
        self.register_buffer("start", torch.cat([torch.zeros(3), identity]), persistent=False)

    def forward(
        self, markers: Tensor, betas: Tensor, passes: int = PASSES
    ) -> tuple[Tensor, Tensor]:
        """Hips [..., F, 3] and rotations [..., F, 22, 3, 3] of markers [..., F, 67, 3].

        The bodies' shapes are betas [..., 10], one for all frames of a row. No gradient flows
        from pass to pass: each learns to correct whatever it is given.
        """
        shape = self.body.shaped(betas)
        centre = markers.mean(-2)
        centred = (markers - centre[..., None, :]).flatten(-2)
        shapes = betas[..., None, :].expand(*centred.shape[:-1], BETAS)
        given = torch.cat([centred, shapes], -1)
        state = self.start.expand(*betas.shape[:-1], 1, STATE)  # the first estimate is of no frame
        for _ in range(passes):
            place, rotations = _unpack(state.detach())
            skinned, _ = self.body.skin(shape, place, rotations)
            state = torch.cat([place, sixd_from_matrix(rotations).flatten(-2)], -1)
            state = state.expand(*centred.shape[:-1], STATE)
            error = _squash(centred - skinned.flatten(-2))
            state = state + self.network(torch.cat([given, error, state], -1))
        place, rotations = _unpack(state)
        return centre + place, rotations


def _unpack(state: Tensor) -> tuple[Tensor, Tensor]:
    """Hips [..., 3] from the markers' centre and rotations [..., 22, 3, 3]."""
    return state[..., :3], matrix_from_6d(state[..., 3:].unflatten(-1, (POSED_JOINTS, 6)))


def _squash(error: Tensor) -> Tensor:
    """Metres, logarithmic: millimetres count, and half a metre does not drown the rest."""
    far = 100 * error
    # asinh(far) / 2, whose own operator is slow
    return 0.5 * torch.sign(far) * torch.log(far.abs() + torch.sqrt(far * far + 1))
