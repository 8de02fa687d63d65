"""Scenarios of `wayfarer eval arrival`: agents that are sent to a goal 3 to 8 m away."""

from dataclasses import dataclass
from math import cos, pi, radians, sin
from typing import Final

import numpy as np

from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.outcome import STAND_SECONDS, STEP_LIMIT
from wayfarer_lab.evaluation.tasks import AgentTask, TimedCommand, random_specs, relative

DISTANCE: Final = (3.0, 8.0)
"""Metres to a goal whose arrival is measured."""

SLACK: Final = 6.0
"""Seconds after the 60 primitives in which a late stand can still begin."""

WALK_SECONDS: Final = 2.0
"""Seconds that an agent walks before its goal changes."""


@dataclass(frozen=True)
class Scenario:
    """A goal 3 … 8 m away in a random direction, given to standing agents."""

    name: str
    walking: bool = False  # the goal comes after 2 s on the way straight ahead
    facing: bool = False  # the goal has a random heading

    @property
    def seconds(self) -> float:
        """Length of a run, from the first order."""
        return self._start + STEP_LIMIT * STEP_SECONDS + SLACK + STAND_SECONDS

    def tasks(self, agents: int, random: np.random.Generator) -> list[AgentTask]:
        """Random people with their orders."""
        return [AgentTask(spec, self._orders(random)) for spec in random_specs(agents, random)]

    @property
    def _start(self) -> float:
        return WALK_SECONDS if self.walking else 0.0

    def _orders(self, random: np.random.Generator) -> tuple[TimedCommand, ...]:
        angle, metres = radians(random.uniform(0, 360)), float(random.uniform(*DISTANCE))
        heading = float(random.uniform(-pi, pi)) if self.facing else None
        away = (metres * cos(angle), metres * sin(angle))
        there = TimedCommand(
            self._start, lambda agent: [Goal(relative(agent, *away), heading=heading)]
        )
        ahead = TimedCommand(0.0, lambda agent: [Goal(relative(agent, 20.0, 0.0))])
        return (ahead, there) if self.walking else (there,)
