"""The goals ahead of agents: for each slot a ring of rows, in order.

Goals of a path are numbered from 0 in order, and keep their numbers when more are added to its end:
*waypoint* n of a path stays waypoint n, and lies at row n modulo the ring. Passed goals are
overwritten. All rings have the length that the longest path has needed. The waypoint that an agent
walks to is in its gait, so it is discarded together with the frames that were planned for it.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.world.agents.goal import Goal, GoalColumns, goal_columns
from wayfarer.world.agents.slots import Slots
from wayfarer.world.rows import Flags, Index

SHORT: Final = 4
"""Goals of a ring at first. All its lengths are powers of two."""


class PathColumns:
    """The paths of all slots of a table."""

    def __init__(self, slots: Slots, limit: int) -> None:
        """`limit`: maximum number of goals per slot that are known at a time."""
        self._slots = slots
        self.limit = limit
        self._length = SHORT
        self._goals = GoalColumns.empty(len(slots.active) * SHORT)

    def put(
        self, slot: int, goals: Sequence[Goal], start: tuple[float, float], first: int = 0
    ) -> None:
        """Replaces a slot's path. The agent walks to goal `first` from `start`, and then to the
        others.

        Without goals, it has no path.
        """
        self._reserve(len(goals))
        waypoints = first + np.arange(max(len(goals), 1))
        columns = goal_columns(goals, start) if goals else GoalColumns.empty(1)
        self._goals.put(self._place(np.array([slot]), waypoints), columns)

    def at(self, slots: Index, waypoints: Index) -> GoalColumns:
        """The goals of some slots at these places of their paths."""
        self._reserve()
        return self._goals.take(self._place(slots, waypoints))

    def places(self, slots: Index, waypoints: Index) -> NDArray[np.float32]:
        """Places [A, 3] of the goals of some slots at these places of their paths."""
        self._reserve()
        return self._goals.position[self._place(slots, waypoints)]

    def move(self, slot: int, waypoint: int, place: NDArray[np.floating[Any]]) -> None:
        """Moves a goal of a slot's path to place [3]."""
        self._goals.position[slot * self._length + waypoint % self._length] = place

    def rewrite(self, slot: int, waypoint: int, row: GoalColumns) -> None:
        """Replaces a goal of a slot's path with another one, one row."""
        self._reserve()
        self._goals.put(self._place(np.array([slot]), np.array([waypoint])), row)

    def is_last(self, slots: Index, waypoints: Index) -> Flags:
        """Whether no goal follows these."""
        self._reserve()
        return ~self._goals.more[self._place(slots, waypoints)]

    def _place(self, slots: Index, waypoints: Index) -> Index:
        return slots * self._length + waypoints % self._length

    def _reserve(self, goals: int = 0) -> None:
        length = 1 << max(goals - 1, 0).bit_length()
        if length > self._length:  # rings repeat, and each goal lies in one of the copies
            rings = np.arange(len(self._goals.given)).reshape(-1, self._length)
            self._goals = self._goals.take(np.tile(rings, length // self._length).ravel())
            self._length = length
        rows = len(self._slots.active) * self._length
        if rows > len(self._goals.given):
            self._goals.grow(rows)
