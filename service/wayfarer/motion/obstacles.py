"""Obstacles near an agent, and how far its body comes into them.

An obstacle is an upright capsule without end, seen from above: a line from a to b with a radius,
moving evenly. A stretch of wall has radius 0; another person moves. As numbers: ax, ay, bx, by
(metres), vx, vy (m/s), radius; a negative radius means none.
"""

import torch
from torch import Tensor

from wayfarer.motion.constants import numbers
from wayfarer.motion.frame import Frame
from wayfarer.spec import FPS, OBSTACLES

COLUMNS = 7

MARGIN = 0.1
"""Metres that a marker should keep from an obstacle."""

EVERY = 4
"""Stride over the new frames: a body walks a tenth of a metre between two of them."""

LEAST = 1e-6


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
    place = points[..., EVERY::EVERY, :, :2]  # [..., f, M, 2]
    frames, markers = place.shape[-3:-1]
    times = numbers(tuple(f * EVERY / FPS for f in range(1, frames + 1)), points)
    moments = torch.stack([torch.ones_like(times), times], -1)[:, None]  # [f, 1, 2]: 1, t
    rows = torch.cat([place, moments.expand(*place.shape[:-1], 2)], -1).flatten(-3, -2)

    a, b, velocity, radius = obstacles.split((2, 2, 2, 1), -1)
    line = b - a + numbers((LEAST, 0.0), a)  # a point lies along x
    length = torch.sqrt((line * line).sum(-1, keepdim=True))
    along = line / length
    across = torch.cat([-along[..., 1:], along[..., :1]], -1)
    axes = torch.cat([along, across], -2)  # [..., 2 O, 2]
    middle = (a + b) / 2
    start = (torch.cat([middle, middle], -2) * axes).sum(-1, keepdim=True)
    speed = (torch.cat([velocity, velocity], -2) * axes).sum(-1, keepdim=True)
    # Where points are on those axes, from the middle of the line as it moves: one product.
    seen = rows @ torch.cat([axes, -start, -speed], -1).transpose(-1, -2)
    beside, apart = seen.split(obstacles.shape[-2], -1)  # [..., f · M, O]
    beyond = (beside.abs() - (length / 2).transpose(-1, -2)).clamp(min=0)
    square = (beyond * beyond + apart * apart).unflatten(-2, (frames, markers)).amin(-2)
    reach = radius.transpose(-1, -2)  # [..., 1, O]
    depth = (MARGIN + reach - torch.sqrt(square + LEAST * LEAST)).clamp(min=0)
    return (depth * (reach >= 0).to(depth.dtype)).amax(-1).mean(-1)
