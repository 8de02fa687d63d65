"""Start poses of simulated agents: standing, mid-walk out of recordings, or made up by the prior.

All at heading 0 with the hips over the origin of the floor; the simulation turns and places them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from wayfarer.errors import InvalidArgument
from wayfarer_lab.training.dataset import Poses, WindowSampler
from wayfarer_lab.training.pose_networks import LATENT, PosePrior, VPoser
from wayfarer_lab.training.rotation import matrix_from_quaternion, matrix_from_rotvec


class SeedPoses(NamedTuple):
    """A seed without a body: S frames of N poses."""

    hips: Tensor  # [N, S, 3]; the height does not matter, since bodies differ
    rotations: Tensor  # [N, S, 22, 3, 3]


@dataclass(frozen=True)
class StartSampler:
    """Draws starts of three kinds by their share."""

    frames: int  # S
    shares: dict[str, float]  # of "standing", "moving", "pose_prior"
    standing: Tensor  # [P, 22, 4] quaternions, heading 0
    moving: Poses
    prior: PosePrior | VPoser

    def draw(self, count: int) -> SeedPoses:
        """`count` starts. Raises InvalidArgument on an unknown kind."""
        kinds: dict[str, Callable[[int], SeedPoses]] = {
            "standing": self._standing,
            "moving": self._moving,
            "pose_prior": self._made_up,
        }
        unknown = sorted(set(self.shares) - set(kinds))
        if unknown:
            raise InvalidArgument(
                f"unknown kinds of start {unknown}; allowed: {list(kinds)}", "starts"
            )
        share = torch.tensor([self.shares.get(kind, 0.0) for kind in kinds])
        drawn = torch.multinomial(share, count, replacement=True).bincount(minlength=len(kinds))
        parts = [kind(n) for kind, n in zip(kinds.values(), drawn.tolist(), strict=True) if n]
        order = torch.randperm(count)
        return SeedPoses(*(torch.cat(field)[order] for field in zip(*parts, strict=True)))

    def _standing(self, count: int) -> SeedPoses:
        rows = torch.randint(len(self.standing), (count,))
        return self._still(matrix_from_quaternion(self.standing[rows]))

    def _made_up(self, count: int) -> SeedPoses:
        with torch.no_grad():
            body = self.prior.decode(torch.randn(count, LATENT))
        upright = torch.eye(3).expand(count, 1, 3, 3)
        return self._still(torch.cat([upright, body], 1))

    def _still(self, pose: Tensor) -> SeedPoses:
        """The same frame S times: at rest."""
        rotations = pose[:, None].expand(-1, self.frames, -1, -1, -1)
        return SeedPoses(torch.zeros(len(pose), self.frames, 3), rotations)

    def _moving(self, count: int) -> SeedPoses:
        rows = WindowSampler(self.moving, self.frames).draw(count)
        window = rows[:, None] + torch.arange(self.frames)
        rotations = matrix_from_quaternion(self.moving.rotations[window])
        right = rotations[:, 0, 0, :2, 0]
        back = about_z(-torch.atan2(right[:, 1], right[:, 0]))
        rotations[:, :, 0] = back[:, None] @ rotations[:, :, 0]
        hips = self.moving.hips[window]
        hips = (hips - hips[:, :1]) @ back.transpose(-1, -2)
        return SeedPoses(hips, rotations)


def about_z(angle: Tensor) -> Tensor:
    """Turns [N, 3, 3] about the vertical by angles [N] in radians."""
    zero = torch.zeros_like(angle)
    return matrix_from_rotvec(torch.stack([zero, zero, angle], -1))
