"""Ways of agents through their scenes, as columns: how far each one is, and what lies ahead."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.world.agents.route import Passage
from wayfarer.world.agents.slots import Slots
from wayfarer.world.rows import Index

Array = NDArray[np.floating[Any]]

BACK: Final = 0.5
"""Metres by which an agent that was pushed or replanned may be behind where it was."""

WINDOW: Final = 2.0
"""Metres: and is looked for so far ahead. So it does not jump to a stretch that passes close by."""


class Routes:
    """Polylines of all slots of a table, padded by their last point. World space, metres."""

    def __init__(self, slots: Slots) -> None:
        self._slots = slots
        self._points = np.zeros((0, 16, 3))
        self._along = np.zeros((0, 16))

    def lay(self, slot: int, points: Array, revision: int, waypoint: int) -> None:
        """Leads a slot by points [P, 3] to a goal of its path."""
        self._reserve(len(points))
        steps = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        self._points[slot, : len(points)] = points
        self._points[slot, len(points) :] = points[-1]
        self._along[slot, : len(points)] = along
        self._along[slot, len(points) :] = along[-1]
        route = self._slots.route
        route.passage[slot] = Passage.OPEN
        route.revision[slot], route.waypoint[slot] = revision, waypoint
        route.points[slot], route.length[slot] = len(points), along[-1]
        route.progress[slot] = 0.0
        route.doubt[slot] = False

    def follow(self, rows: Index, places: Array) -> Array:
        """Go on to the points of the ways nearest to places [A, 2]; metres they are off [A]."""
        self._reserve()
        route, points, along = self._slots.route, self._points[rows, :, :2], self._along[rows]
        since = route.progress[rows].astype(np.float64)[:, None]
        low = np.maximum(along[:, :-1], since - BACK)
        high = np.minimum(along[:, 1:], since + WINDOW)
        steps = points[:, 1:] - points[:, :-1]
        lengths = along[:, 1:] - along[:, :-1]
        ways = steps / np.maximum(lengths, 1e-9)[..., None]
        offset = places[:, None] - points[:, :-1]
        share = np.minimum(np.maximum((offset * ways).sum(-1), low - along[:, :-1]), high)
        share = np.minimum(share, high - along[:, :-1])
        apart = offset - share[..., None] * ways
        gaps = np.where(low <= high, (apart * apart).sum(-1), np.inf)
        best = gaps.argmin(1)
        pick = np.arange(len(rows)), best
        route.progress[rows] = along[pick] + share[pick]
        return np.sqrt(gaps[pick])

    def ends(self, rows: Index) -> Array:
        """The last points [A, 3] of the ways."""
        return self._points[rows, -1]

    def at(self, rows: Index, metres: Array) -> Array:
        """Points [A, S, 3] of the ways at `metres` [A, S] from their starts."""
        self._reserve()
        along = self._along[rows]
        last = np.maximum(self._slots.route.points[rows] - 2, 0)[:, None]
        which = np.minimum((along[:, None, 1:] <= metres[..., None]).sum(-1), last)
        row = rows[:, None]
        start, end = self._points[row, which], self._points[row, which + 1]
        before = self._along[row, which]
        length = np.maximum(self._along[row, which + 1] - before, 1e-9)
        share = np.minimum(np.maximum((metres - before) / length, 0), 1)
        found: Array = start + share[..., None] * (end - start)
        return found

    def rest(self, slot: int, beyond: float = 0.0) -> Array:
        """What of a way lies more than `beyond` metres ahead: points [P, 3], P ≥ 1."""
        route = self._slots.route
        begin, count = float(route.progress[slot]) + beyond, int(route.points[slot])
        here = self.at(np.array([slot]), np.array([[begin]]))[0]
        ahead = self._along[slot, :count] > begin
        return np.concatenate([here, self._points[slot, :count][ahead]])

    def forget(self, rows: Index | Sequence[int]) -> None:
        """These have no way."""
        self._slots.route.passage[rows] = Passage.UNKNOWN

    def _reserve(self, points: int = 0) -> None:
        slots, width = len(self._slots.active), self._along.shape[1]
        if slots <= len(self._along) and points <= width:
            return
        wider = width if points <= width else 1 << (points - 1).bit_length()
        # The padding repeats the last point.
        self._points = np.pad(self._points, ((0, 0), (0, wider - width), (0, 0)), "edge")
        self._along = np.pad(self._along, ((0, 0), (0, wider - width)), "edge")
        more = slots - len(self._along)
        self._points = np.pad(self._points, ((0, more), (0, 0), (0, 0)))
        self._along = np.pad(self._along, ((0, more), (0, 0)))
