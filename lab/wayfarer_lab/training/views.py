"""Bodies over some frames, as a critic and the measure of manners see them."""

from typing import Final, NamedTuple

import torch
from torch import Tensor

from wayfarer.motion.frame import canonical_frame, to_local

EVERY: Final = 2
"""Stride of the frames that are seen."""

TURN: Final = 0.4
"""Metres that count as much as a radian, where ways are compared."""


class BodyFrames(NamedTuple):
    """Bodies at some frames, world space."""

    markers: Tensor  # [A, T, 67, 3]
    hips: Tensor  # [A, T, 3]
    turns: Tensor  # [A, T, 3, 3] rotations of the hips

    def ways(self) -> Tensor:
        """Where hips are in the middle and at the end, seen from the first frame, and how far they
        have turned [A, 5].
        """
        frame = canonical_frame(self.hips[:, 0], self.turns[:, 0])
        middle = self.hips.shape[1] // 2
        places = to_local(frame, self.hips[:, [middle, -1]])[..., :2]
        facing = (self.turns[:, -1, :2, 1][:, None] @ frame.rotation[:, :2, :2])[:, 0]
        turn = torch.atan2(-facing[:, 0], facing[:, 1])
        return torch.cat([places.flatten(1), TURN * turn[:, None]], -1)

    def windows(self, pack: int) -> Tensor:
        """The markers seen from the first frame, some at once [A / pack, pack, T, 67, 3]."""
        frame = canonical_frame(self.hips[:, 0], self.turns[:, 0])
        local = to_local(frame, self.markers.flatten(1, 2)).unflatten(1, self.markers.shape[1:3])
        return local.unflatten(0, (-1, pack))

    def of(self, rows: Tensor) -> "BodyFrames":
        """That of some agents, by index."""
        return BodyFrames(*(column[rows] for column in self))


def joined(views: list[BodyFrames]) -> BodyFrames:
    """One after the other in time."""
    return BodyFrames(*(torch.cat(columns, 1) for columns in zip(*views, strict=True)))
