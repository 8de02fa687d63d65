"""Goals that move: rewritten in an agent's path before its steps, without a new revision."""

from math import hypot
from typing import Final

import numpy as np

from wayfarer.navigation.scene_spec import Point3
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.world.agents.behaviour import Agent, Aim, BodyState
from wayfarer.world.agents.goal import Goal, GoalColumns
from wayfarer.world.agents.heading import facing_of
from wayfarer.world.agents.slots import Slots
from wayfarer.world.agents.velocity import FORESIGHT, moving
from wayfarer.world.goals.path_columns import PathColumns

RADIUS: Final = 0.25
AGAIN: Final = 0.35
"""Metres outside its radius beyond which a reached goal is walked to again."""


class MovingGoals:
    """The moving goals of a world; each is the last of its agent's path."""

    def __init__(self, slots: Slots, paths: PathColumns) -> None:
        self._slots = slots
        self._paths = paths

    def body(self, slot: int, other: int) -> BodyState:
        """An agent's extrapolated state at the moment up to which another one is planned."""
        slots, seed = self._slots, self._slots.planned.seed
        hips = seed.translation[[slot]]
        [velocity] = moving(hips, slots.planned.gait.speed[[slot]])
        frames = slots.start_frame + NEW_FRAMES * slots.planned_chunks
        ahead = float(np.clip((frames[other] - frames[slot]) / FPS, -FORESIGHT, FORESIGHT))
        x, y = (hips[0, -1, :2] + ahead * velocity).tolist()
        vx, vy = velocity.tolist()
        ahead_x, ahead_y = facing_of(seed.rotations[slot, -1, 0]).tolist()
        return BodyState((x, y), (vx, vy), (ahead_x, ahead_y))

    def place(self, agent: Agent) -> tuple[float, float]:
        """The planned place of an agent."""
        x, y = self._slots.planned.seed.translation[agent.slot, -1, :2].tolist()
        return x, y

    def standing(self, agent: Agent) -> tuple[float, float] | None:
        """The place where the agent last should stand; None while its goal moved."""
        goal = agent.path[-1]
        return goal.position[:2] if goal.stop else None

    def is_moving(self, agent: Agent) -> bool:
        """Whether its goal was not one to stand at."""
        return not agent.path[-1].stop

    def stand(self, agent: Agent) -> None:
        """Makes it stand where it comes to rest."""
        agent.path = (*agent.path[:-1], Goal(agent.path[-1].position))
        self._put(agent, GoalColumns.empty(1))

    def go(self, agent: Agent, aim: Aim, place: Point3) -> None:
        """Makes it walk to a place for now, and stand there unless the place is to pass through."""
        gait, slot = self._slots.planned.gait, agent.slot
        row = GoalColumns.empty(1)
        row.given[:] = True
        row.position[0], row.speed[:] = place, aim.speed
        if aim.onward is not None:
            row.through[:], row.onward[0] = True, aim.onward
            gait.arrived[slot] = False
        else:
            row.radius[:], row.heading[0] = RADIUS, aim.facing or (0.0, 0.0)
            x, y = self._slots.planned.seed.translation[slot, -1, :2].tolist()
            if hypot(x - place[0], y - place[1]) > RADIUS + AGAIN:
                gait.arrived[slot] = False
        stops = aim.onward is None
        agent.path = (*agent.path[:-1], Goal(place, RADIUS, speed=aim.speed, stop=stops))
        self._put(agent, row)

    def _put(self, agent: Agent, row: GoalColumns) -> None:
        waypoint = agent.passed + len(agent.path) - 1
        self._paths.rewrite(agent.slot, waypoint, row)
