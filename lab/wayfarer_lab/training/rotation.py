"""Conversions between rotation representations. Batched, differentiable, exportable.

Matrices act on column vectors; quaternions are x, y, z, w. The 6D form is the first two
columns of the matrix, one after the other (Zhou et al., CVPR 2019; paper reference [82]).
"""

import torch
from torch import Tensor

from wayfarer.motion import posing


def matrix_from_6d(sixd: Tensor) -> Tensor:
    """Orthonormalises two columns (Gram-Schmidt). [..., 6] → [..., 3, 3]."""
    return posing.from_6d(sixd.movedim(-1, 0)).movedim((0, 1), (-2, -1))


def sixd_from_matrix(matrix: Tensor) -> Tensor:
    """First two columns. [..., 3, 3] → [..., 6]."""
    return torch.cat([matrix[..., :, 0], matrix[..., :, 1]], dim=-1)


def matrix_from_quaternion(quaternion: Tensor) -> Tensor:
    """[..., 4] (x, y, z, w; normalised here) → [..., 3, 3]."""
    return posing.from_quaternion(quaternion.movedim(-1, 0)).movedim((0, 1), (-2, -1))


def quaternion_from_matrix(matrix: Tensor) -> Tensor:
    """[..., 3, 3] → [..., 4] (x, y, z, w; w ≥ 0)."""
    return posing.to_quaternion(matrix.movedim((-2, -1), (0, 1))).movedim(0, -1)


def matrix_from_rotvec(rotvec: Tensor) -> Tensor:
    """Axis times angle in radians [..., 3] → [..., 3, 3] (Rodrigues; safe at zero)."""
    squared = (rotvec * rotvec).sum(-1)[..., None, None]
    angle = torch.sqrt(squared + 1e-12)
    x, y, z = rotvec.unbind(-1)
    zero = torch.zeros_like(x)
    k = torch.stack(
        [
            torch.stack([zero, -z, y], -1),
            torch.stack([z, zero, -x], -1),
            torch.stack([-y, x, zero], -1),
        ],
        -2,
    )
    eye = torch.eye(3, dtype=rotvec.dtype, device=rotvec.device)
    return eye + torch.sin(angle) / angle * k + (1 - torch.cos(angle)) / (angle * angle) * (k @ k)


def rotvec_from_matrix(matrix: Tensor) -> Tensor:
    """[..., 3, 3] → axis times angle in radians [..., 3], angle ≤ π."""
    quaternion = quaternion_from_matrix(matrix)
    vector, w = quaternion[..., :3], quaternion[..., 3:]
    sine = torch.sqrt((vector * vector).sum(-1, keepdim=True) + 1e-16)
    return vector * (2 * torch.atan2(sine, w) / sine)
