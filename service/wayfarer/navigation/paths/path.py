"""A path, and where on it an agent should head for."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.spec import Point3

Array = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Path:
    """A way over free ground. World space, metres."""

    points: Array
    """Waypoints from start to goal, on the floor. [P, 3], P ≥ 1"""
    start_moved: float
    """Metres between the start asked for and the first point: 0 where it was free ground."""
    goal_moved: float
    """The same of the goal: the nearest free ground that can be reached was taken."""
    scene_hash: str
    scene_version: int
    """The scene that it was found in. A later one may block it: `Scene.is_clear`."""

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

    def at(self, metres: Array) -> Array:
        """Points so far from the start. [...] → [..., 3]"""
        return np.stack([np.interp(metres, self.along, axis) for axis in self.points.T], -1)

    def progress(self, position: Array, since: float = 0.0, window: float = 2.0) -> float:
        """Metres from the start to the point of the path nearest to a position [2 | 3].

        Looks from `since` (where the agent was seen last) over `window` metres, so that progress
        never goes back and does not jump between stretches that pass close by each other.
        """
        until = min(since + window, self.length)
        stops = np.concatenate(
            [[since], self.along[(self.along > since) & (self.along < until)], [until]]
        )
        spots = self.at(stops)[:, :2]
        start, step = spots[:-1], np.diff(spots, axis=0)
        square = np.maximum((step * step).sum(1), 1e-12)
        share = np.clip(((position[:2] - start) * step).sum(1) / square, 0, 1)
        gaps = np.linalg.norm(start + share[:, None] * step - position[:2], axis=1)
        best = int(gaps.argmin())
        return float(stops[best] + share[best] * (stops[best + 1] - stops[best]))


@dataclass(frozen=True, slots=True)
class Ahead:
    """Where to head for now."""

    target: Point3
    progress: float
    """Metres of the path behind the agent: hand it in as `since` next time."""
    left: float
    """Metres of the path before the agent."""
