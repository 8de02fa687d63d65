"""The path of an agent as messages and as columns, which are kept equal here."""

from dataclasses import replace

import numpy as np

from wayfarer.world.agents.behaviour import Agent
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.slots import Gait, Mode, Slots
from wayfarer.world.goals.path_columns import PathColumns


class AgentPaths:
    """Paths of a world's agents. A path may be extended endlessly: passed goals are forgotten."""

    def __init__(self, slots: Slots, paths: PathColumns) -> None:
        self._slots = slots
        self._paths = paths

    def write(self, agent: Agent, goals: tuple[Goal, ...]) -> None:
        """Sets the goals that are not forgotten. On the flat floor they lie at height 0."""
        in_scene = bool(self._slots.scene[agent.slot])
        agent.path = goals if in_scene else tuple(map(_on_floor, goals))
        self._paths.put(agent.slot, agent.path, agent.path_start, agent.passed)

    def kept(self, agent: Agent) -> tuple[Goal, ...]:
        """Forgets the goals to which even a replan cannot return; returns the others."""
        slot = agent.slot
        oldest = 0 if self.is_ahead_of_sent(slot) else int(self._sent_waypoint(slot))
        done = oldest - agent.passed
        if done > 0:
            x, y, _ = agent.path[done - 1].position
            agent.path, agent.passed, agent.path_start = agent.path[done:], oldest, (x, y)
        return agent.path

    def so_far(self, agent: Agent) -> tuple[Goal, ...]:
        """The kept goals up to the present one."""
        kept = self.kept(agent)
        return kept[: int(self._slots.planned.gait.waypoint[agent.slot]) - agent.passed + 1]

    def replace_goals(self, agent: Agent, goals: tuple[Goal, ...], walks: bool = True) -> int:
        """Replaces the goals after the present one; plans stay. Returns the first new number."""
        before = self.so_far(agent)
        self.write(agent, (*before, *goals))
        first = agent.passed + len(before)
        set_out(self._slots.planned.gait, agent.slot, first, walks)
        return first

    def is_ahead_of_sent(self, slot: int) -> bool:
        """Whether nothing that was planned for the present path has been sent yet."""
        return bool(self._slots.sent_chunks[slot] <= self._slots.revised_chunk[slot])

    def _sent_waypoint(self, slot: int) -> int:
        return int(self._slots.committed.gait.waypoint[slot])


def _on_floor(goal: Goal) -> Goal:
    x, y, z = goal.position
    return replace(goal, position=(x, y, 0.0)) if z else goal


def set_out(gait: Gait, row: int, waypoint: int, walks: bool) -> None:
    """Starts an agent's way to a goal. Without one it continues until steering stops it."""
    if walks:
        gait.mode[row] = Mode.WALKING
    gait.arrived[row] = False
    gait.waypoint[row] = waypoint


def is_done(slots: Slots, slot: int, goal: Goal, slow_seconds: float) -> bool:
    """Whether an agent has passed its present goal, or stood there for its dwell."""
    gait = slots.planned.gait
    if not gait.arrived[slot] or not goal.stop:
        return bool(gait.arrived[slot])
    dwelt = gait.slow_seconds[slot] >= slow_seconds + np.float32(goal.dwell) - 1e-3
    return bool(gait.mode[slot] == Mode.STANDING and dwelt)
