"""What agents in training are asked to do: walk at all speeds to all sides, stop, stand, turn.

The same quantities that `runtime/steering.py` gives an agent who is served, drawn at random, so
that one policy learns them all.
"""

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from wayfarer.terms import STAND, TURN, WALK, weights

WALKING, STANDING, TURNING = range(3)
SHARES = (0.6, 0.25, 0.15)
TABLES = torch.tensor([weights(table) for table in (WALK, STAND, TURN)])

SPEEDS = (0.4, 1.8)
RUNNING = (1.8, 3.2)
RUN_SHARE = 0.08
STRAFE_SHARE = 0.1
DISTANCES = (0.5, 8.0)
STRAY = 0.25
"""Metres: spread of the place to stand at around where the agent is."""

CHANGE = 1 / 20
"""Chance at every step that an agent is asked for something else."""

ARRIVED = 0.2
"""Metres from the goal at which a walker is asked to stand there."""

SLOWING = 1.0
SLOWEST = 0.5
"""As `Steering`: from 1 m before the goal the target speed falls, to 0.5 m/s."""


@dataclass
class Tasks:
    """Columns over A agents, world space."""

    kind: Tensor  # [A] WALKING, STANDING or TURNING
    goal: Tensor  # [A, 3]
    speed: Tensor  # [A] m/s
    facing: Tensor  # [A, 2]

    def put(self, rows: Tensor, other: "Tasks") -> None:
        """Replace some agents' tasks."""
        for column in fields(self):
            getattr(self, column.name)[rows] = getattr(other, column.name)

    def target_speed(self, place: Tensor) -> Tensor:
        """Speed wished for now [A] of agents at `place` [A, 2]: less near the goal."""
        distance = (self.goal[:, :2] - place).norm(dim=-1)
        slowing = torch.maximum(self.speed * distance / SLOWING, torch.tensor(SLOWEST))
        wished = torch.minimum(self.speed, slowing)
        return torch.where(self.kind == WALKING, wished, torch.zeros_like(wished))

    def term_weights(self) -> Tensor:
        """[A, T]"""
        return TABLES[self.kind]

    def renew(self, place: Tensor) -> None:
        """Let walkers who are there stand, and give some agents something else to do."""
        distance = (self.goal[:, :2] - place).norm(dim=-1)
        there = (self.kind == WALKING) & (distance < ARRIVED)
        self.kind[there] = STANDING
        self.facing[there] = 0.0
        change = torch.nonzero(torch.rand(len(place)) < CHANGE).squeeze(-1)
        self.put(change, draw_tasks(place[change]))


def draw_tasks(place: Tensor) -> Tasks:
    """Random tasks of agents at `place` [A, 2]."""
    count = len(place)
    kind = (
        torch.multinomial(torch.tensor(SHARES), count, replacement=True) if count else place[:, 0]
    )
    kind = kind.long()
    walking = kind == WALKING
    distance = torch.where(walking, _uniform(count, *DISTANCES), STRAY * torch.randn(count).abs())
    ground = place + distance[:, None] * _direction(count)
    fast = torch.rand(count) < RUN_SHARE
    speed = torch.where(fast, _uniform(count, *RUNNING), _uniform(count, *SPEEDS))
    faces = (kind == TURNING) | (walking & ~fast & (torch.rand(count) < STRAFE_SHARE))
    return Tasks(
        kind=kind,
        goal=torch.cat([ground, torch.zeros(count, 1)], -1),
        speed=speed,
        facing=_direction(count) * faces[:, None],
    )


def _uniform(count: int, low: float, high: float) -> Tensor:
    return low + (high - low) * torch.rand(count)


def _direction(count: int) -> Tensor:
    angle = 2 * torch.pi * torch.rand(count)
    return torch.stack([torch.cos(angle), torch.sin(angle)], -1)
