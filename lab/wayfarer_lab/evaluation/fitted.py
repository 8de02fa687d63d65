"""Reprojection by optimisation, as MOJO's, in the place of the body regressor.

MOJO finds the body behind predicted markers by gradient descent on the distance of its markers
from them, beginning at the pose before. Here too; what keeps poses plausible where markers leave
them open is nearness to that pose, instead of MOJO's VPoser. All frames of a primitive are fitted
at once, and handed on as they are found: nothing is joined to the seed.
"""

import math
from typing import Final

import torch
from torch import Tensor

from wayfarer.motion.marker_body import MarkerBody, Shaped
from wayfarer.motion.posing import from_6d, to_6d
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.motion.regressor import Pose

RATE: Final = 0.03
"""Adam's first rate, per iteration: metres of the hips, and numbers of 6D rotations."""

NEARNESS: Final = 1e-4
"""Weight of a changed 6D number, squared, against square metres summed over markers."""


def fit_body(
    body: MarkerBody, shape: Shaped, markers: Tensor, start: Pose, iterations: int
) -> Pose:
    """The poses whose markers are nearest to `markers` [A, F, 67, 3], from one pose before each.

    `start` has one frame: hips [3, 1, A], rotations [3, 3, 22, 1, A]. Rows do not influence each
    other except for rounding.
    """
    frames = markers.shape[1]
    wanted = markers.detach().transpose(-1, -2)
    first = to_6d(start.rotations).detach()  # [6, 22, 1, A]
    with torch.enable_grad():
        hips = start.hips.detach().repeat(1, frames, 1).requires_grad_()
        turns = first.repeat(1, 1, frames, 1).requires_grad_()
        optimizer = torch.optim.Adam([hips, turns], lr=RATE)
        for number in range(iterations):
            for group in optimizer.param_groups:
                group["lr"] = RATE * 0.5 * (1 + math.cos(math.pi * number / iterations))
            found = body.blend(shape, body.place(shape, hips, from_6d(turns)))
            loss = (found - wanted).square().sum() + NEARNESS * (turns - first).square().sum()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
    return Pose(hips.detach(), from_6d(turns.detach()))


class FittedStep(PrimitiveStep):
    """A step that finds its bodies by `iterations` of optimisation."""

    iterations: int = 0

    def _body(
        self, seed: Tensor, future: Tensor, betas: Tensor, shape: Shaped, shown: Pose
    ) -> Pose:
        last = Pose(shown.hips[:, -1:], shown.rotations[..., -1:, :])
        return fit_body(self.body, shape, future, last, self.iterations)
