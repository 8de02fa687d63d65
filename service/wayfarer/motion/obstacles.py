"""What stands or walks near an agent, and how far its body comes into it.

An obstacle is an upright capsule without end, seen from above: a line from a to b with a radius,
moving evenly. A stretch of wall is one with radius 0, another person one that moves. As numbers:
ax, ay, bx, by (metres), vx, vy (m/s), radius; below 0 it is none.
"""

import torch
from torch import Tensor

from wayfarer.motion.constants import numbers
from wayfarer.motion.frame import Frame
from wayfarer.spec import FPS, OBSTACLES

COLUMNS = 7

MARGIN = 0.1
"""Metres that a marker should keep from an obstacle."""

EVERY = 2
"""Every so many-th new frame is looked at: a body comes 5 cm farther between them."""

LEAST = 1e-9


def no_obstacles(agents: int) -> Tensor:
    """[A, O, 7] for agents with nothing near them."""
    nothing = torch.zeros(agents, OBSTACLES, COLUMNS)
    nothing[..., -1] = -1
    return nothing


def localised(frame: Frame, obstacles: Tensor) -> Tensor:
    """World obstacles [A, O, 7] in the agents' frames."""
    lines = obstacles[..., :6].unflatten(-1, (3, 2))  # a, b, velocity
    moved = frame.origin[:, None, None, :2] * numbers((1.0, 1.0, 0.0), lines)[:, None]
    turned = (lines - moved).flatten(1, 2) @ frame.rotation[:, :2, :2]
    return torch.cat([turned.unflatten(1, (-1, 3)).flatten(2), obstacles[..., 6:]], -1)


def intrusion(points: Tensor, obstacles: Tensor) -> Tensor:
    """Metres by which the deepest point comes nearer than `MARGIN`, mean over frames.

    points [..., 1 + F, M, 3], the last seed frame first; obstacles [..., O, 7] → [...]
    """
    frames = points.shape[-3]
    times = numbers(tuple(f / FPS for f in range(EVERY, frames, EVERY)), points)
    place = points[..., EVERY::EVERY, :, None, :2]  # [..., f, M, 1, 2]
    a, b, velocity, radius = obstacles[..., None, None, :, :].split((2, 2, 2, 1), -1)
    along = b - a
    offset = place - (a + times[:, None, None, None] * velocity)
    square = (along * along).sum(-1).clamp(min=LEAST)
    share = ((offset * along).sum(-1) / square).clamp(0, 1)
    apart = offset - share[..., None] * along
    gap = torch.sqrt((apart * apart).sum(-1) + LEAST) - radius[..., 0]
    depth = (MARGIN - gap).clamp(min=0) * (radius[..., 0] >= 0).to(gap.dtype)
    return depth.amax((-1, -2)).mean(-1)
