"""Posture, which no quality term of the service looks at.

Crouching, knees beyond their limits, and predicted markers that no body can follow.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians

import torch
from torch import Tensor

from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.primitive import BLEND
from wayfarer_lab.training.crowd import TrainingCrowd
from wayfarer_lab.training.rotation import matrix_from_quaternion

LOW_WAIST = 0.92
"""Share of the waist's height in the T-pose below which a body crouches."""

BENT, STRAIGHT = radians(115), radians(-3)
"""Knees bend no farther than this, and not beyond straight."""


@dataclass(frozen=True)
class Posture:
    """Indices of the markers that posture is read from."""

    waist: list[int]
    hips: list[int]  # left, right
    knees: list[tuple[int, int]]  # of each side the marker on its left, and on its right
    ankles: list[int]

    @classmethod
    def from_names(cls, names: Sequence[str]) -> "Posture":
        """Of a body's markers. Raises KeyError when one is missing."""
        at = {name: i for i, name in enumerate(names)}
        return cls(
            waist=[at[n] for n in ("LFWT", "LBWT", "RFWT", "RBWT")],
            hips=[at["LHIP"], at["RHIP"]],
            knees=[(at["LKNE"], at["LKNI"]), (at["RKNI"], at["RKNE"])],
            ankles=[at["LANK"], at["RANK"]],
        )

    def strain(self, markers: Tensor, resting: Tensor) -> Tensor:
        """Cost [A] of poses [A, 67, 3] of bodies whose T-pose is `resting` [A, 3, 67].

        5 cm of crouching cost 1, and so do 30 degrees beyond a knee's limits.
        """
        height = resting[:, 2, self.waist].mean(-1) - resting[:, 2].amin(-1)
        crouching = (LOW_WAIST * height - markers[:, self.waist, 2].mean(-1)).clamp(min=0)
        flexion = self.knee_flexion(markers)
        beyond = (flexion - BENT).clamp(min=0) + (STRAIGHT - flexion).clamp(min=0)
        return 20 * crouching + 2 * beyond.sum(-1)

    def knee_flexion(self, markers: Tensor) -> Tensor:
        """Radians [..., 2] by which the left and the right knee of poses [..., 67, 3] bend."""
        found = []
        for hip, (left, right), ankle in zip(self.hips, self.knees, self.ankles, strict=True):
            knee = (markers[..., left, :] + markers[..., right, :]) / 2
            thigh, shin = knee - markers[..., hip, :], markers[..., ankle, :] - knee
            axis = markers[..., right, :] - markers[..., left, :]
            axis = torch.nn.functional.normalize(axis, dim=-1)
            sine = -(torch.cross(thigh, shin, dim=-1) * axis).sum(-1)
            found.append(torch.atan2(sine, (thigh * shin).sum(-1)))
        return torch.stack(found, -1)


LOOSE = 0.015
"""Metres by which predicted markers may miss the body's: the prior's own miss it by 1.2 cm."""


def off_body(after: TrainingCrowd, body: MarkerBody) -> Tensor:
    """Mean distance [A], metres, from the last predicted markers to those of the body behind them.

    The terms look at predicted markers, and people see the body. Without a price on what lies
    between, a policy finds latents whose markers are no body's (soles on the floor, the body 8 cm
    above it). The slope is that of the markers: the body is taken as it is.
    """
    with torch.no_grad():
        rotations = matrix_from_quaternion(after.rotations)
        skin, _ = body.skin(body.shaped(after.betas), after.translation, rotations)
    # the next seed lies `BLEND` of the way from the predicted markers to the body's
    return (after.markers - skin).norm(dim=-1).mean((-1, -2)) / (1 - BLEND)
