"""The body regressor: body parameters from markers, frame by frame (paper Sec. 3.2.1, Fig. 2).

Residual blocks, applied twice, the second pass correcting the first (as in HMR). Rotations are 6D
inside and matrices at the output. Two networks per gender, one for each pass.

Deviations from the paper, and why: every pass also sees where the markers of its estimate lie, as
their distance from the given ones, so it learns to correct, not to guess again. The paper applies
one network repeatedly. Here each pass has its own, and two suffice; the first finds only the
first, the middle and the last frame, the others are interpolated. Markers are centred on their mean
(the hips' place is found relative to it), so that neither the floor nor the travelled way matters.
The first estimate is the T-pose instead of zeros, which 6D cannot orthonormalise. Fingers are held
at rest, so the hand term of Eq. 2 has nothing to act on with the
default body.
"""

import itertools
from typing import NamedTuple, cast

import torch
from torch import Tensor, nn
from torch.nn.functional import linear

from wayfarer.motion.constants import constant, indices
from wayfarer.motion.layers import ResidualBlock
from wayfarer.motion.marker_body import MarkerBody, Shaped
from wayfarer.motion.posing import from_6d, to_6d, to_columns, to_rows
from wayfarer.spec import BETAS, MARKERS, POSED_JOINTS

STATE = 3 + POSED_JOINTS * 6
HIDDEN = 128
BLOCKS = 10
NETWORKS = 2

RECURSIONS = 3
"""Passes of a regressor with one network, as in the paper."""

CUBIC, FIFTH, SEVENTH = 1.3576, 0.5392, 1.3424
"""Coefficients of 4 atanh(x) = 4 x + …, fitted for the least error up to x = 2 / 3."""


class Pose(NamedTuple):
    """Body parameters of F frames of A bodies, poses last."""

    hips: Tensor  # [3, F, A]
    rotations: Tensor  # [3, 3, 22, F, A] local


class Estimate(NamedTuple):
    """The result of a pass."""

    frames: list[int]
    pose: Pose


class BodyRegressor(nn.Module):
    """Finds the hips' place and 22 local rotations of `body`'s poses."""

    start: Tensor
    by_coordinate: Tensor
    by_number: Tensor

    def __init__(self, body: MarkerBody, networks: int = NETWORKS, through: bool = False) -> None:
        """One of `networks` for each pass, or one for all; `through`: gradients flow through all.

        With one network, as in the paper, there are `RECURSIONS` passes, all of every frame.
        """
        super().__init__()
        self.body = body
        self.through = through
        self.networks = nn.ModuleList(_network() for _ in range(networks))
        identity = torch.tensor([1.0, 0, 0, 0, 1, 0]).repeat_interleave(POSED_JOINTS)
        self._keep("start", torch.cat([torch.zeros(3), identity]))
        # The weights are trained in the order of markers and joints; rows are kept by coordinate.
        coordinates = torch.arange(MARKERS * 3).view(MARKERS, 3).T.flatten()
        turns = torch.arange(POSED_JOINTS * 6).view(POSED_JOINTS, 6).T.flatten() + 3
        self._keep("by_coordinate", coordinates)
        self._keep("by_number", torch.cat([torch.arange(3), turns]))

    def _keep(self, name: str, values: Tensor) -> None:
        self.register_buffer(name, values, persistent=False)

    def forward(self, markers: Tensor, betas: Tensor) -> tuple[Tensor, Tensor]:
        """Hips [A, F, 3] and rotations [A, F, 22, 3, 3] of markers [A, F, 67, 3].

        The bodies' shapes are betas [A, 10], one for all frames of a row.
        """
        found = self.solve(markers, betas, self.body.shaped(betas))
        return to_rows(found.hips.transpose(0, 1)), to_rows(found.rotations.permute(3, 2, 0, 1, 4))

    def solve(self, markers: Tensor, betas: Tensor, shape: Shaped) -> Pose:
        """As `forward`, poses last; `shape` is that of `betas`."""
        return self.estimates(markers, betas, shape)[-1].pose

    def estimates(self, markers: Tensor, betas: Tensor, shape: Shaped) -> list[Estimate]:
        """The result of each pass; the last one finds all frames.

        Unless `through`, no gradient flows from pass to pass: each learns to correct its input.
        """
        axes = markers.transpose(-1, -2)
        centre = axes.mean(-1)
        centred = axes - centre[..., None]  # [A, F, 3, 67]
        everything = list(range(markers.shape[1]))
        found: list[Estimate] = []
        skinned, rows = self.body.resting(betas)[:, None], self.start[None, None]
        for network, frames in self._passes(len(everything)):
            if found:
                skinned, rows = self._pass_inputs(rows, shape)
            given, place = centred, centre
            if frames != everything:
                given, place = (v.index_select(1, indices(frames, v)) for v in (centred, centre))
            rows = rows + self.correct(network, given, given - skinned, betas, rows)
            pose = _unpack(rows)
            at = Pose(to_columns(place).transpose(0, 1) + pose.hips, pose.rotations)
            found.append(Estimate(frames, at))
            if frames != everything:
                rows = _spread(rows, len(everything))
        return found

    def _passes(self, frames: int) -> list[tuple[nn.Sequential, list[int]]]:
        """The network of each pass, and the frames that it finds."""
        networks = [cast(nn.Sequential, network) for network in self.networks]
        everything = list(range(frames))
        if len(networks) == 1:
            return [(networks[0], everything)] * RECURSIONS
        return [(networks[0], knots(frames)), *((n, everything) for n in networks[1:])]

    def _pass_inputs(self, rows: Tensor, shape: Shaped) -> tuple[Tensor, Tensor]:
        """Estimates [A, F, 135] as a pass sees them: as markers and as rotations."""
        pose = _unpack(rows if self.through else rows.detach())
        skinned = self.body.blend(shape, self.body.place(shape, pose.hips, pose.rotations))
        return skinned, _pack(pose)

    def correct(
        self, network: nn.Sequential, centred: Tensor, error: Tensor, betas: Tensor, rows: Tensor
    ) -> Tensor:
        """The change that a pass adds to the estimates, [A, F, 135].

        Markers `centred` and their `error` [A, F, 3, 67]; betas [A, 10]. `rows` are the estimates,
        or one for all [1, 1, 135].
        """
        first, last = cast(nn.Linear, network[0]), cast(nn.Linear, network[-1])
        of_markers, of_shapes, of_errors, of_states = first.weight.split(
            [MARKERS * 3, BETAS, MARKERS * 3, STATE], 1
        )
        x = (
            _linear(centred.flatten(2), of_markers.index_select(1, self.by_coordinate))
            + _linear(_squash(error.flatten(2)), of_errors.index_select(1, self.by_coordinate))
            + _linear(rows, of_states.index_select(1, self.by_number))
        )
        agents = betas.shape[0]
        of_bodies = linear(betas, of_shapes, first.bias)[:, None]
        hidden = (of_bodies + x.unflatten(0, (agents, -1))).flatten(0, 1)
        for block in list(network)[1:-1]:
            hidden = block(hidden)
        weight, bias = (v.index_select(0, self.by_number) for v in (last.weight, last.bias))
        return linear(hidden, weight, bias).unflatten(0, (agents, -1))


def knots(frames: int) -> list[int]:
    """The frames that the first of several networks finds: the first, the middle and the last."""
    return sorted({0, frames // 2, frames - 1})


def _network() -> nn.Sequential:
    output = nn.Linear(HIDDEN, STATE)
    nn.init.normal_(output.weight, std=1e-3)
    nn.init.zeros_(output.bias)
    return nn.Sequential(
        nn.Linear(2 * MARKERS * 3 + STATE + BETAS, HIDDEN),
        *(ResidualBlock(HIDDEN) for _ in range(BLOCKS)),
        output,
    )


def _spread(rows: Tensor, frames: int) -> Tensor:
    """Estimates of all frames [A, F, 135] from those of the knots."""
    known = rows.transpose(0, 1)
    between = constant(known, _between, frames, known.dtype)
    # One product for all, as in `PrimitiveStep`: rows must not depend on their number.
    return (between @ known.flatten(1)).unflatten(1, known.shape[1:]).transpose(0, 1)


def _between(frames: int, dtype: torch.dtype) -> Tensor:
    """Shares [F, N] of the knots in each frame: linear between the two nearest."""
    shares = torch.zeros(frames, len(knots(frames)), dtype=dtype)
    shares[knots(frames), range(len(knots(frames)))] = 1
    for number, (a, b) in enumerate(itertools.pairwise(knots(frames))):
        for frame in range(a + 1, b):
            share = (frame - a) / (b - a)
            shares[frame, number], shares[frame, number + 1] = 1 - share, share
    return shares


def _linear(x: Tensor, weight: Tensor) -> Tensor:
    """A product of all rows of [A, F, ·], as one matrix [A · F, ·]."""
    return linear(x.flatten(0, 1), weight)


def _unpack(rows: Tensor) -> Pose:
    """Rows [A, F, 135]: the hips' place relative to the markers' centre, then 6D numbers."""
    numbers = to_columns(rows).transpose(0, 1)
    return Pose(numbers[:3], from_6d(numbers[3:].unflatten(0, (6, POSED_JOINTS))))


def _pack(pose: Pose) -> Tensor:
    """Rows [A, F, 135] of estimates, orthonormalised."""
    numbers = torch.cat([pose.hips, to_6d(pose.rotations).flatten(0, 1)])
    return to_rows(numbers.transpose(0, 1))


def _squash(error: Tensor) -> Tensor:
    """asinh(100 · error) / 2 of metres: millimetres count, and half a metre does not hide the rest.

    Engines are slow at logarithms, so the argument is halved three times (2 sinh(x / 2) =
    2 sinh x / sqrt(2 + 2 cosh x), and 2 cosh(x / 2) is that root), until a short series suffices:
    within .0003, or .02 % of the value, up to 3 m.
    """
    sinh = 200 * error  # twice
    half = torch.sqrt(torch.sqrt(sinh * sinh + 4) + 2)  # twice the cosine of the half, and so on
    fourth = torch.sqrt(half + 2)
    tanh = sinh / (half * fourth * (fourth + 2))  # of the eighth
    square = tanh * tanh
    return tanh * (4 + square * (CUBIC + square * (FIFTH + square * SEVENTH)))
