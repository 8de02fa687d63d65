"""A way over free ground."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.scene_spec import Point3

Array = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class GroundPath:
    """A way over free ground. World space, metres."""

    points: Array
    """Waypoints from start to goal, on the floor. [P, 3], P ≥ 1"""
    start_moved: float
    """Metres between the requested start and the first point; 0: it was free ground."""
    goal_moved: float
    """The same for the goal: the nearest free ground that can be reached."""
    scene_version: int
    """The scene in which it was found. A later one may block it: `Scene.is_clear`."""

    @cached_property
    def along(self) -> Array:
        """Metres from the start to each waypoint, in plan. [P]"""
        steps = np.linalg.norm(np.diff(self.points[:, :2], axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def length(self) -> float:
        """Metres from start to goal, in plan."""
        return float(self.along[-1])

    @property
    def goal(self) -> Point3:
        """The last waypoint."""
        x, y, z = self.points[-1].tolist()
        return x, y, z
