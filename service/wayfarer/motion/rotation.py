"""Conversions between rotation representations. Batched, differentiable, exportable.

Matrices act on column vectors; quaternions are x, y, z, w. The 6D form is the first two
columns of the matrix, one after the other (Zhou et al., CVPR 2019; paper reference [82]).
"""

import torch
from torch import Tensor


def matrix_from_6d(sixd: Tensor) -> Tensor:
    """Orthonormalise two columns (Gram-Schmidt). [..., 6] → [..., 3, 3]."""
    a, b = sixd[..., :3], sixd[..., 3:]
    x = torch.nn.functional.normalize(a, dim=-1, eps=1e-6)
    y = torch.nn.functional.normalize(b - (x * b).sum(-1, keepdim=True) * x, dim=-1, eps=1e-6)
    return torch.stack([x, y, torch.linalg.cross(x, y)], dim=-1)


def sixd_from_matrix(matrix: Tensor) -> Tensor:
    """First two columns. [..., 3, 3] → [..., 6]."""
    return torch.cat([matrix[..., :, 0], matrix[..., :, 1]], dim=-1)


def matrix_from_quaternion(quaternion: Tensor) -> Tensor:
    """[..., 4] (x, y, z, w; normalised here) → [..., 3, 3]."""
    x, y, z, w = torch.nn.functional.normalize(quaternion, dim=-1).unbind(-1)
    rows = [
        torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
        torch.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
        torch.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1),
    ]
    return torch.stack(rows, -2)


def quaternion_from_matrix(matrix: Tensor) -> Tensor:
    """[..., 3, 3] → [..., 4] (x, y, z, w; w ≥ 0).

    Of the four ways to read the quaternion off the matrix, the one whose pivot is largest is
    stable; all four are computed and that one is selected, so there is no data-dependent branch.
    """
    m00, m01, m02 = matrix[..., 0, :].unbind(-1)
    m10, m11, m12 = matrix[..., 1, :].unbind(-1)
    m20, m21, m22 = matrix[..., 2, :].unbind(-1)
    # each row is 4·q_i·(x, y, z, w) with pivot i; its i-th entry is 4·q_i²
    rows = torch.stack(
        [
            torch.stack([1 + m00 - m11 - m22, m01 + m10, m02 + m20, m21 - m12], -1),
            torch.stack([m01 + m10, 1 - m00 + m11 - m22, m12 + m21, m02 - m20], -1),
            torch.stack([m02 + m20, m12 + m21, 1 - m00 - m11 + m22, m10 - m01], -1),
            torch.stack([m21 - m12, m02 - m20, m10 - m01, 1 + m00 + m11 + m22], -1),
        ],
        -2,
    )
    pivots = torch.diagonal(rows, dim1=-2, dim2=-1)
    best = torch.argmax(pivots, dim=-1, keepdim=True)
    row = torch.gather(rows, -2, best[..., None].expand(*best.shape, 4)).squeeze(-2)
    unit = torch.nn.functional.normalize(row, dim=-1)
    return torch.where(unit[..., 3:] < 0, -unit, unit)


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
