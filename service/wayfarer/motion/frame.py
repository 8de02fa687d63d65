"""The canonical frame of a primitive (paper Sec. 3.1) and the way there and back.

Origin: under the hips joint of the first seed frame, on the floor (z = 0 of the world), or at the
hips themselves (the paper's choice). X: horizontal part of left hip → right hip. Z: up.
Y = Z × X: forward.

With the paper's origin the networks never see the floor, and height drifts as a random walk;
the floor origin is therefore the default (docs/models.md lists all deviations).
"""

from typing import NamedTuple

import torch
from torch import Tensor

from wayfarer.motion.constants import numbers


class Frame(NamedTuple):
    """A canonical frame per row: `world = rotation @ local + origin`."""

    rotation: Tensor  # [..., 3, 3] a turn about Z
    origin: Tensor  # [..., 3]


def canonical_frame(hips: Tensor, hips_rotation: Tensor, floor_origin: bool = True) -> Frame:
    """Frame of rows whose first seed frame has its hips joint at `hips` [..., 3].

    The hip joints are fixed to the hips bone, along its X axis in the rest pose; so the
    direction from left to right hip is the first column of `hips_rotation` [..., 3, 3].
    """
    right = hips_rotation[..., :2, 0]
    right = right / torch.sqrt((right * right).sum(-1, keepdim=True) + 1e-12)
    cos, sin = right.unbind(-1)
    zero, one = torch.zeros_like(cos), torch.ones_like(cos)
    rotation = torch.stack(
        [
            torch.stack([cos, -sin, zero], -1),
            torch.stack([sin, cos, zero], -1),
            torch.stack([zero, zero, one], -1),
        ],
        -2,
    )
    keep = numbers((1.0, 1.0, 0.0 if floor_origin else 1.0), hips)
    return Frame(rotation, hips * keep)


def to_local(frame: Frame, points: Tensor) -> Tensor:
    """World points [..., N, 3] into frames [...]."""
    # row vectors: Rᵀ p = p R
    return (points - frame.origin[..., None, :]) @ frame.rotation


def to_world(frame: Frame, points: Tensor) -> Tensor:
    """Points [..., N, 3] out of frames [...]."""
    return points @ frame.rotation.transpose(-1, -2) + frame.origin[..., None, :]
