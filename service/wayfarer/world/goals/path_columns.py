"""The goals that agents have ahead of them: for each slot a ring of rows, in order.

Goals of a path are numbered from 0 as they were given, and keep their numbers when more are
added to its end: *waypoint* n of a path stays waypoint n, and lies at row n modulo the ring. Those
that the agent has passed are overwritten. Which one it is on the way to is in its gait, so it is
thrown away with the frames that were planned for it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.world.agents.goal import Goal, GoalColumns, goal_columns
from wayfarer.world.agents.slots import Slots
from wayfarer.world.rows import Flags, Index


class PathColumns:
    """The paths of all slots of a table."""

    def __init__(self, slots: Slots, limit: int) -> None:
        """At most `limit` goals per slot are known at a time."""
        self._slots = slots
        self.limit = limit
        self._goals = GoalColumns.empty(len(slots.active) * limit)

    def put(
        self, slot: int, goals: Sequence[Goal], start: tuple[float, float], first: int = 0
    ) -> None:
        """Replace a slot's path by one whose goal `first` is walked to from `start`, and so on.

        No goals: it has none.
        """
        self._reserve()
        waypoints = first + np.arange(max(len(goals), 1))
        columns = goal_columns(goals, start) if goals else GoalColumns.empty(1)
        self._goals.put(self._place(np.array([slot]), waypoints), columns)

    def at(self, slots: Index, waypoints: Index) -> GoalColumns:
        """The goals of some slots at these places of their paths."""
        self._reserve()
        return self._goals.take(self._place(slots, waypoints))

    def places(self, slots: Index, waypoints: Index) -> NDArray[np.float32]:
        """Where the goals of some slots at these places of their paths are [A, 3]."""
        self._reserve()
        return self._goals.position[self._place(slots, waypoints)]

    def move(self, slot: int, waypoint: int, place: NDArray[np.floating[Any]]) -> None:
        """Put a goal of a slot's path elsewhere, place [3]."""
        self._goals.position[slot * self.limit + waypoint % self.limit] = place

    def rewrite(self, slot: int, waypoint: int, row: GoalColumns) -> None:
        """Put another goal, one row, in the place of one of a slot's path."""
        self._reserve()
        self._goals.put(self._place(np.array([slot]), np.array([waypoint])), row)

    def is_last(self, slots: Index, waypoints: Index) -> Flags:
        """Whether no goal follows after these."""
        self._reserve()
        return ~self._goals.more[self._place(slots, waypoints)]

    def _place(self, slots: Index, waypoints: Index) -> Index:
        return slots * self.limit + waypoints % self.limit

    def _reserve(self) -> None:
        rows = len(self._slots.active) * self.limit
        if rows > len(self._goals.given):
            self._goals.grow(rows)
