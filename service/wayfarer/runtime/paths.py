"""The goals that agents have ahead of them: for each slot a block of rows, in order.

Which of them an agent is on the way to is in its gait (`waypoint`), so it is thrown away with the
frames that were planned for it.
"""

from collections.abc import Sequence

import numpy as np

from wayfarer.runtime.agent import Goal
from wayfarer.runtime.heading import angle_between, facing_at
from wayfarer.runtime.rows import Index
from wayfarer.runtime.slots import Goals, Slots


class Paths:
    """The paths of all slots of a table."""

    def __init__(self, slots: Slots, limit: int) -> None:
        """At most `limit` goals per slot."""
        self._slots = slots
        self._limit = limit
        self._goals = Goals.empty(len(slots.active) * limit)

    def put(self, slot: int, goals: Sequence[Goal], start: tuple[float, float]) -> None:
        """Replace a slot's path, walked from `start`; no goals: it has none."""
        self._reserve()
        first = slot * self._limit
        rows = np.arange(first, first + max(len(goals), 1))
        self._goals.put(rows, goal_columns(goals, start) if goals else Goals.empty(1))

    def at(self, slots: Index, waypoints: Index) -> Goals:
        """The goals of some slots at these places of their paths."""
        self._reserve()
        return self._goals.take(slots * self._limit + waypoints)

    def _reserve(self) -> None:
        rows = len(self._slots.active) * self._limit
        if rows > len(self._goals.given):
            self._goals.grow(rows)


def goal_columns(goals: Sequence[Goal], start: tuple[float, float]) -> Goals:
    """One row for each goal of a path that is walked from `start`."""
    made = Goals.empty(len(goals))
    made.given[:] = True
    made.position[:] = [goal.position for goal in goals]
    made.radius[:] = [goal.radius for goal in goals]
    made.speed[:] = [goal.speed for goal in goals]
    made.dwell[:] = [goal.dwell for goal in goals]
    made.heading[:] = [(0, 0) if g.heading is None else facing_at(g.heading) for g in goals]
    made.strafe[:] = [goal.strafe for goal in goals]
    made.through[:] = [not goal.stop for goal in goals]
    made.more[:-1] = True
    ways = np.diff(np.concatenate([np.array([start]), made.position[:, :2]]), axis=0)
    ways /= np.maximum(np.linalg.norm(ways, axis=-1, keepdims=True), 1e-6)
    made.onward[:] = np.concatenate([ways[1:], ways[-1:]])  # past the last one, straight on
    made.bend[:] = angle_between(ways, made.onward)
    return made
