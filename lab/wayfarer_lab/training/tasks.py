"""What agents in training are asked to do: walk at all speeds to all sides, stop, stand, turn.

The same quantities that `runtime/world/steering.py` gives an agent who is served, drawn at random,
so that one policy learns them all.
"""

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from wayfarer.spec import STEP_SECONDS
from wayfarer.terms import STAND, STRAFE, TURN, WALK, weights

WALKING, STANDING, TURNING, STRAFING = range(4)
SHARES = (0.52, 0.22, 0.15, 0.11)
TABLES = torch.tensor([weights(table) for table in (WALK, STAND, TURN, STRAFE)])

SPEEDS = (0.4, 1.8)
RUNNING = (1.8, 3.2)
RUN_SHARE = 0.08
STRAFING_SPEEDS = (0.3, 0.9)
DISTANCES = (0.5, 8.0)
STRAY = 0.25
"""Metres: spread of the place to stand at around where the agent is."""

CHANGE = 1 / 14
"""Chance at every step that an agent is asked for something else."""

ARRIVED = 0.2
"""Metres from the goal at which a walker is asked to stand there."""

SLOWING = 0.7
SLOWEST = 0.7
ACCELERATION = 2.0
"""As `Steering`: from 0.7 m before the goal the target speed falls, to 0.7 m/s, and it is never
more than what 2 m/s² add to the present speed in one step."""


@dataclass
class Tasks:
    """Columns over A agents, world space."""

    kind: Tensor  # [A] WALKING, STANDING, TURNING or STRAFING
    goal: Tensor  # [A, 3]
    speed: Tensor  # [A] m/s
    facing: Tensor  # [A, 2]

    def put(self, rows: Tensor, other: "Tasks") -> None:
        """Replace some agents' tasks."""
        for column in fields(self):
            getattr(self, column.name)[rows] = getattr(other, column.name)

    @property
    def moves(self) -> Tensor:
        """Agents [A] that are on the way to their goal."""
        return (self.kind == WALKING) | (self.kind == STRAFING)

    def target_speed(self, place: Tensor, speed: Tensor) -> Tensor:
        """Speed wished for now [A] of agents at `place` [A, 2] who move at `speed` [A]."""
        distance = (self.goal[:, :2] - place).norm(dim=-1)
        slowing = (self.speed * distance / SLOWING).clamp(min=SLOWEST)
        wished = torch.minimum(self.speed, slowing)
        wished = torch.minimum(wished, speed + ACCELERATION * STEP_SECONDS)
        return torch.where(self.moves, wished, torch.zeros_like(wished))

    def term_weights(self) -> Tensor:
        """[A, T]"""
        return TABLES[self.kind]

    def renew(self, place: Tensor, facing: Tensor) -> None:
        """Let walkers who are there stand, facing as they do; give some something else to do.

        Agents are at `place` [A, 2] and face the unit vectors `facing` [A, 2].
        """
        distance = (self.goal[:, :2] - place).norm(dim=-1)
        there = self.moves & (distance < ARRIVED)
        self.kind[there] = STANDING
        self.facing[there] = facing[there]
        change = torch.nonzero(torch.rand(len(place)) < CHANGE).squeeze(-1)
        self.put(change, draw_tasks(place[change], facing[change]))


def draw_tasks(place: Tensor, facing: Tensor) -> Tasks:
    """Random tasks of agents at `place` [A, 2] who face the unit vectors `facing` [A, 2]."""
    count = len(place)
    kind = (
        torch.multinomial(torch.tensor(SHARES), count, replacement=True) if count else place[:, 0]
    )
    kind = kind.long()
    moves = (kind == WALKING) | (kind == STRAFING)
    distance = torch.where(moves, _uniform(count, *DISTANCES), STRAY * torch.randn(count).abs())
    ground = place + distance[:, None] * _direction(count)
    fast = (torch.rand(count) < RUN_SHARE) & (kind == WALKING)
    speed = torch.where(fast, _uniform(count, *RUNNING), _uniform(count, *SPEEDS))
    speed = torch.where(kind == STRAFING, _uniform(count, *STRAFING_SPEEDS), speed)
    anywhere = (kind == TURNING) | (kind == STRAFING)
    wished = torch.where(anywhere[:, None], _direction(count), facing)
    return Tasks(
        kind=kind,
        goal=torch.cat([ground, torch.zeros(count, 1)], -1),
        speed=speed,
        facing=wished * (kind != WALKING)[:, None],
    )


def _uniform(count: int, low: float, high: float) -> Tensor:
    return low + (high - low) * torch.rand(count)


def _direction(count: int) -> Tensor:
    angle = 2 * torch.pi * torch.rand(count)
    return torch.stack([torch.cos(angle), torch.sin(angle)], -1)
