"""What agents are asked for while a policy learns: random requests, as users may send them."""

from dataclasses import dataclass, fields
from math import pi
from typing import Final

import torch
from torch import Tensor

from wayfarer.spec import STEP_SECONDS

WALK, STRAFE, TURN = 0.40, 0.22, 0.22
"""Shares of orders; the others stand."""

SLOW: Final = 0.3
"""Share of the walks that are slower than `SLOW_SPEED`: recordings hardly have any."""

SLOW_SPEED: Final = 0.6
"""m/s"""

CURVED: Final = 0.3
"""Share of the walks that go in curves."""

TIGHT, WIDE = 1.0, 4.0
"""Metres: radii of curves."""

AHEAD: Final = 2.2
"""Metres from an agent to the goal of its curve, which turns about it: so far that it does not slow
down."""


@dataclass
class Orders:
    """Requests to A agents, world space: the same quantities as in the service."""

    goal: Tensor  # [A, 2] m
    speed: Tensor  # [A] m/s; 0: stand at the goal
    facing: Tensor  # [A, 2] unit vector, or zero: the way to the goal
    bend: Tensor  # [A] radians to the left by which a goal turns about its agent in a step

    @property
    def goes(self) -> Tensor:
        """Agents [A] that are asked to go somewhere."""
        return self.speed > 0

    @property
    def walks(self) -> Tensor:
        """Agents [A] that are asked to go ahead: no side steps."""
        return self.goes & ~self.facing.any(-1)

    @property
    def curves(self) -> Tensor:
        """Agents [A] that are asked to go in a curve."""
        return self.bend != 0

    @property
    def slow(self) -> Tensor:
        """Agents [A] that are asked to go slowly."""
        return self.goes & (self.speed < SLOW_SPEED)

    def follow(self, place: Tensor) -> None:
        """Moves the goals of curves on, for agents at `place` [A, 2]."""
        way = rotated(self.goal - place, self.bend)
        way = AHEAD * way / way.norm(dim=-1, keepdim=True).clamp(min=1e-6)
        self.goal = torch.where(self.curves[:, None], place + way, self.goal)

    def put(self, rows: Tensor, other: "Orders") -> None:
        """Replaces those of rows [A] that are true by those of `other`, of as many agents."""
        for column in fields(self):
            mine, new = getattr(self, column.name), getattr(other, column.name)
            chosen = rows.view(-1, *(1,) * (mine.dim() - 1))
            setattr(self, column.name, torch.where(chosen, new, mine))


def draw_orders(place: Tensor, facing: Tensor) -> Orders:
    """Random orders of agents at `place` [A, 2] who face `facing` [A, 2]."""
    count = len(place)
    kind = torch.rand(count)
    walks, strafes = kind < WALK, (kind >= WALK) & (kind < WALK + STRAFE)
    turns = (kind >= WALK + STRAFE) & (kind < WALK + STRAFE + TURN)
    ahead = torch.where(torch.rand(count) < 0.5, 0.5 * torch.randn(count), _between(count, -pi, pi))
    left = torch.where(torch.rand(count) < 0.5, 0.5 * pi, -0.5 * pi)
    aside = torch.where(torch.rand(count) < 0.33, torch.full((count,), pi), left)
    angle = torch.where(strafes, aside + 0.3 * torch.randn(count), ahead)
    goes = walks | strafes
    distance = torch.where(goes, _between(count, 0.3, 6.0), 0.12 * torch.randn(count).abs())
    speed = torch.where(
        torch.rand(count) < 0.12, _between(count, 1.8, 2.8), _between(count, 0.6, 1.7)
    )
    speed = torch.where(torch.rand(count) < SLOW, _between(count, 0.15, SLOW_SPEED), speed)
    speed = torch.where(strafes, _between(count, 0.25, 1.25), speed) * goes
    curved = walks & (torch.rand(count) < CURVED) & (speed > SLOW_SPEED) & (speed < 1.8)
    side = torch.sign(torch.rand(count) - 0.5)
    bend = curved * side * speed * STEP_SECONDS / _between(count, TIGHT, WIDE)
    off = torch.where(turns, _between(count, -pi, pi), 0.1 * torch.randn(count))
    return Orders(
        goal=place + rotated(facing, angle) * distance[:, None],
        speed=speed,
        facing=rotated(facing, off) * (~walks)[:, None],
        bend=bend,
    )


def rotated(vectors: Tensor, angle: Tensor) -> Tensor:
    """Vectors [A, 2] turned to the left by angles [A]."""
    cos, sin = torch.cos(angle), torch.sin(angle)
    x, y = vectors.unbind(-1)
    return torch.stack([cos * x - sin * y, sin * x + cos * y], -1)


def _between(count: int, low: float, high: float) -> Tensor:
    return low + (high - low) * torch.rand(count)
