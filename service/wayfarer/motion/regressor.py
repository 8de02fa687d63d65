"""The body regressor: body parameters from markers, frame by frame (paper Sec. 3.2.1, Fig. 2).

Residual blocks applied three times over, each pass correcting the last (as in HMR). Rotations are
6D inside and matrices at the output. One network per gender.

Deviations from the paper, and why: every pass also sees where the markers of its estimate lie, as
their distance from the given ones; so it learns to correct, not to guess again. Markers are centred
on their mean (the hips' place is found relative to it), so that neither the floor nor the
travelled way matters; the first estimate is the T-pose rather than zeros, which 6D cannot
orthonormalise; fingers are held at rest, so the hand term of Eq. 2 has nothing to act on with the
default body.
"""

from typing import NamedTuple, cast

import torch
from torch import Tensor, nn
from torch.nn.functional import linear

from wayfarer.motion.layers import ResidualBlock
from wayfarer.motion.marker_body import MarkerBody, Shaped
from wayfarer.motion.posing import from_6d, to_6d, to_columns, to_rows
from wayfarer.spec import BETAS, MARKERS, POSED_JOINTS

STATE = 3 + POSED_JOINTS * 6
HIDDEN = 128
BLOCKS = 10
PASSES = 3

CUBIC, FIFTH, SEVENTH = 1.3576, 0.5392, 1.3424
"""Coefficients of 4 atanh(x) = 4 x + …, fitted for the least error up to x = 2 / 3."""


class Pose(NamedTuple):
    """Body parameters of F frames of A bodies, poses last."""

    hips: Tensor  # [3, F, A]
    rotations: Tensor  # [3, 3, 22, F, A] local


class BodyRegressor(nn.Module):
    """Finds the hips' place and 22 local rotations of `body`'s poses."""

    start: Tensor
    by_coordinate: Tensor
    by_number: Tensor

    def __init__(self, body: MarkerBody, passes: int = PASSES, through: bool = False) -> None:
        """`passes` unless asked for otherwise; `through`: gradients flow through all of them."""
        super().__init__()
        self.body = body
        self.passes = passes
        self.through = through
        output = nn.Linear(HIDDEN, STATE)
        nn.init.normal_(output.weight, std=1e-3)
        nn.init.zeros_(output.bias)
        self.network = nn.Sequential(
            nn.Linear(2 * MARKERS * 3 + STATE + BETAS, HIDDEN),
            *(ResidualBlock(HIDDEN) for _ in range(BLOCKS)),
            output,
        )
        identity = torch.tensor([1.0, 0, 0, 0, 1, 0]).repeat_interleave(POSED_JOINTS)
        self._keep("start", torch.cat([torch.zeros(3), identity]))
        # The weights are trained in the order of markers and joints; rows are kept by coordinate.
        coordinates = torch.arange(MARKERS * 3).view(MARKERS, 3).T.flatten()
        turns = torch.arange(POSED_JOINTS * 6).view(POSED_JOINTS, 6).T.flatten() + 3
        self._keep("by_coordinate", coordinates)
        self._keep("by_number", torch.cat([torch.arange(3), turns]))

    def _keep(self, name: str, values: Tensor) -> None:
        self.register_buffer(name, values, persistent=False)

    def forward(
        self, markers: Tensor, betas: Tensor, passes: int | None = None
    ) -> tuple[Tensor, Tensor]:
        """Hips [A, F, 3] and rotations [A, F, 22, 3, 3] of markers [A, F, 67, 3].

        The bodies' shapes are betas [A, 10], one for all frames of a row. Unless `through`, no
        gradient flows from pass to pass: each learns to correct whatever it is given.
        """
        found = self.solve(markers, betas, self.body.shaped(betas), passes)
        return to_rows(found.hips.transpose(0, 1)), to_rows(found.rotations.permute(3, 2, 0, 1, 4))

    def solve(
        self, markers: Tensor, betas: Tensor, shape: Shaped, passes: int | None = None
    ) -> Pose:
        """As `forward`, poses last; `shape` is that of `betas`."""
        agents = markers.shape[0]
        axes = markers.transpose(-1, -2)
        centre = axes.mean(-1)
        centred = axes - centre[..., None]  # [A, F, 3, 67]
        known = self.know(centred.flatten(2), betas)
        skinned, rows = self.body.resting(betas)[:, None], self.start[None]
        state = rows
        for number in range(passes or self.passes):
            if number:
                pose = _unpack(state if self.through else state.detach(), agents)
                skinned = self.body.blend(shape, self.body.place(shape, pose.hips, pose.rotations))
                rows = _pack(pose)
            error = _squash((centred - skinned).flatten(2).flatten(0, 1))
            state = rows + self.correct(known, error, rows)
        pose = _unpack(state, agents)
        return Pose(to_columns(centre).transpose(0, 1) + pose.hips, pose.rotations)

    def know(self, centred: Tensor, betas: Tensor) -> Tensor:
        """The first layer's share that is the same in all passes [A · F, 128]; of [A, F, 201]."""
        first = cast(nn.Linear, self.network[0])
        markers = first.weight[:, : MARKERS * 3].index_select(1, self.by_coordinate)
        shapes = first.weight[:, MARKERS * 3 : MARKERS * 3 + BETAS]
        of_markers = linear(centred.flatten(0, 1), markers).unflatten(0, centred.shape[:2])
        return (linear(betas, shapes, first.bias)[:, None] + of_markers).flatten(0, 1)

    def correct(self, known: Tensor, error: Tensor, state: Tensor) -> Tensor:
        """What to add to the estimates [A · F or 1, 135], by number; `error` by coordinate."""
        layers = list(self.network)
        first, last = cast(nn.Linear, layers[0]), cast(nn.Linear, layers[-1])
        begin = MARKERS * 3 + BETAS
        errors = first.weight[:, begin : begin + MARKERS * 3].index_select(1, self.by_coordinate)
        states = first.weight[:, begin + MARKERS * 3 :].index_select(1, self.by_number)
        x = known + linear(error, errors) + linear(state, states)
        for block in layers[1:-1]:
            x = block(x)
        weight, bias = (v.index_select(0, self.by_number) for v in (last.weight, last.bias))
        return linear(x, weight, bias)


def _unpack(state: Tensor, agents: int) -> Pose:
    """Rows [A · F, 135]: the hips' place relative to the markers' centre, then 6D numbers."""
    numbers = to_columns(state.unflatten(0, (agents, -1))).transpose(0, 1)
    return Pose(numbers[:3], from_6d(numbers[3:].unflatten(0, (6, POSED_JOINTS))))


def _pack(pose: Pose) -> Tensor:
    """Rows [A · F, 135] of estimates, orthonormalised."""
    numbers = torch.cat([pose.hips, to_6d(pose.rotations).flatten(0, 1)])
    return to_rows(numbers.transpose(0, 1)).flatten(0, 1)


def _squash(error: Tensor) -> Tensor:
    """asinh(100 · error) / 2 of metres: millimetres count, half a metre does not drown the rest.

    Engines are slow at logarithms. So the argument is halved three times (2 sinh(x / 2) =
    2 sinh x / sqrt(2 + 2 cosh x), and 2 cosh(x / 2) is that root), until a short series will do:
    within .0003, or .02 % of the value, up to 3 m.
    """
    sinh = 200 * error  # twice
    half = torch.sqrt(torch.sqrt(sinh * sinh + 4) + 2)  # twice the cosine of the half, and so on
    fourth = torch.sqrt(half + 2)
    tanh = sinh / (half * fourth * (fourth + 2))  # of the eighth
    square = tanh * tanh
    return tanh * (4 + square * (CUBIC + square * (FIFTH + square * SEVENTH)))
