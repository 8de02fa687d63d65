"""What agents in training are asked to do: walk at all speeds to all sides, stop, stand, turn.

The same quantities that `world/goals/steering.py` gives an agent who is served, drawn at random,
so that one policy learns them all.
"""

from dataclasses import dataclass, fields
from math import cos, pi, radians, sin
from typing import Annotated

import torch
from pydantic import BaseModel, ConfigDict, Field, model_validator
from torch import Tensor

from wayfarer.spec import STEP_SECONDS
from wayfarer.terms import STAND, STRAFE, TURN, WALK, weights

WALKING, STANDING, TURNING, STRAFING = range(4)
TABLES = torch.tensor([weights(table) for table in (WALK, STAND, TURN, STRAFE)])

SPEEDS = (0.4, 1.8)
RUNNING = (1.8, 3.2)
RUN_SHARE = 0.08
STRAFING_SPEEDS = (0.3, 0.9)
DISTANCES = (0.5, 8.0)
KEEP_FACING = 0.7
"""Share of strafers who are to face on as they do; the others first have to turn."""

STRAFING_WAYS = (0.5, -0.5, 1.0)
"""Half turns from the facing asked for to the way of who strafes: left, right, back, …"""

ASIDE = 0.35
"""… give or take radians of this spread, as of walkers' goals straight ahead or behind."""

TURN_STEP = radians(40)
"""As `Steering.turn_ahead`: nobody is asked to turn by more in one step."""

STRAY = 0.25
"""Metres: spread of the place to stand at around where the agent is."""

ARRIVED = 0.2
"""Metres from the goal at which a walker is asked to stand there."""

SLOWING = 0.7
SLOWEST = 0.7
ACCELERATION = 2.0
"""As `Steering`: from 0.7 m before the goal the target speed falls, to 0.7 m/s, and it is never
more than what 2 m/s² add to the present speed in one step."""


Weight = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]


class TaskMix(BaseModel):
    """Section [tasks] of an analytic training: what agents are asked to do, and how often."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    walk: Weight = 0.38  # shares of the tasks
    stand: Weight = 0.22
    turn: Weight = 0.2
    strafe: Weight = 0.2
    behind: Share = 0.25  # of walkers' goals: straight behind, give or take `ASIDE`
    ahead: Share = 0.0  # … straight ahead, and twice as far
    aside: float = Field(default=180.0, gt=0, le=180)  # degrees: the others are no farther aside
    change: Share = 1 / 14  # chance at every step of another task, of who stays where he is
    change_moving: Share = 1 / 14  # … of who is on the way

    @model_validator(mode="after")
    def _possible(self) -> "TaskMix":
        if not sum(self.shares):
            raise ValueError("walk, stand, turn and strafe are all 0: nothing is asked")
        if self.behind + self.ahead > 1:
            raise ValueError("behind and ahead are shares of the same goals: at most 1 together")
        return self

    @property
    def shares(self) -> tuple[float, float, float, float]:
        """By kind of task."""
        return self.walk, self.stand, self.turn, self.strafe


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
        """Target speed now [A] of agents at `place` [A, 2] who move at `speed` [A]."""
        distance = (self.goal[:, :2] - place).norm(dim=-1)
        slowing = (self.speed * distance / SLOWING).clamp(min=SLOWEST)
        target = torch.minimum(self.speed, slowing)
        target = torch.minimum(target, speed + ACCELERATION * STEP_SECONDS)
        return torch.where(self.moves, target, torch.zeros_like(target))

    def wished_facing(self, facing: Tensor) -> Tensor:
        """The facing [A, 2] that a step asks for at its end, of agents that face `facing` [A, 2].

        It is no farther than `TURN_STEP` from where they face now: a floor on the time to turn.
        """
        given = (self.facing**2).sum(-1, keepdim=True)  # 1 or 0
        cosine = (facing * self.facing).sum(-1, keepdim=True)
        left = torch.stack([-facing[:, 1], facing[:, 0]], -1)
        side = (left * self.facing).sum(-1, keepdim=True)
        side = torch.where(side < 0, -1.0, 1.0)
        most = cos(TURN_STEP) * facing + side * sin(TURN_STEP) * left
        return given * torch.where(cosine < cos(TURN_STEP), most, self.facing)

    def term_weights(self) -> Tensor:
        """[A, T]"""
        return TABLES[self.kind]

    def renew(self, place: Tensor, facing: Tensor, mix: TaskMix) -> None:
        """Let walkers who are there stand, facing as they do; give some something else to do.

        Agents are at `place` [A, 2] and face the unit vectors `facing` [A, 2].
        """
        distance = (self.goal[:, :2] - place).norm(dim=-1)
        there = self.moves & (distance < ARRIVED)
        self.kind[there] = STANDING
        self.facing[there] = facing[there]
        chance = torch.where(self.moves, mix.change_moving, mix.change)
        change = torch.nonzero(torch.rand(len(place)) < chance).squeeze(-1)
        self.put(change, draw_tasks(place[change], facing[change], mix))


def draw_tasks(place: Tensor, facing: Tensor, mix: TaskMix) -> Tasks:
    """Random tasks of agents at `place` [A, 2] who face the unit vectors `facing` [A, 2]."""
    count = len(place)
    kind = torch.zeros(0, dtype=torch.long)
    if count:
        kind = torch.multinomial(torch.tensor(mix.shares), count, replacement=True)
    walking, strafing = kind == WALKING, kind == STRAFING
    fast = (torch.rand(count) < RUN_SHARE) & walking
    speed = torch.where(fast, _uniform(count, *RUNNING), _uniform(count, *SPEEDS))
    speed = torch.where(strafing, _uniform(count, *STRAFING_SPEEDS), speed)
    kept = ((torch.rand(count) < KEEP_FACING) & strafing) | (kind == STANDING)
    asked = torch.where(kept[:, None], facing, _direction(count))

    stray = ASIDE * torch.randn(count)
    where = torch.rand(count)
    behind, ahead = where < mix.behind, (where >= mix.behind) & (where < mix.behind + mix.ahead)
    angle = radians(mix.aside) * (2 * torch.rand(count) - 1)
    angle = torch.where(behind, pi + stray, torch.where(ahead, stray, angle))
    way = _turned(facing, angle)
    ways = torch.tensor(STRAFING_WAYS)[torch.randint(len(STRAFING_WAYS), (count,))]
    way = torch.where(strafing[:, None], _turned(asked, pi * ways + stray), way)
    moves = walking | strafing
    distance = torch.where(moves, _uniform(count, *DISTANCES), STRAY * torch.randn(count).abs())
    distance = torch.where(walking & ahead, 2 * distance, distance)
    ground = place + distance[:, None] * way
    return Tasks(
        kind=kind,
        goal=torch.cat([ground, torch.zeros(count, 1)], -1),
        speed=speed,
        facing=asked * ~walking[:, None],
    )


def _uniform(count: int, low: float, high: float) -> Tensor:
    return low + (high - low) * torch.rand(count)


def _direction(count: int) -> Tensor:
    angle = 2 * torch.pi * torch.rand(count)
    return torch.stack([torch.cos(angle), torch.sin(angle)], -1)


def _turned(facing: Tensor, angle: Tensor) -> Tensor:
    """Unit vectors [A, 2] turned to the left by `angle` [A] radians."""
    left = torch.stack([-facing[:, 1], facing[:, 0]], -1)
    return torch.cos(angle)[:, None] * facing + torch.sin(angle)[:, None] * left
