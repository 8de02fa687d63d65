"""Ground that only a low ceiling parts: how low it is, and where."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.algorithms import components
from wayfarer.navigation.ground.levels import Floors, Stands
from wayfarer.navigation.scene_spec import Point3, Walkable

Array = NDArray[np.floating[Any]]
Ints = NDArray[np.int64]

LOWEST: Final = 0.5
"""Share of the headroom asked for down to which ways are looked for."""
GRAIN: Final = 0.01
"""Metres."""
MOST: Final = 8
"""Low places that are told of."""
SPOTS: Final = 40
"""Places that stand for a part of the ground."""


@dataclass(frozen=True, slots=True)
class LowPlace:
    """Where headroom is short between two parts of the ground, which no other way joins."""

    room: float
    """Metres of headroom, on the way that has most of it."""
    at: Point3
    sides: tuple[tuple[Point3, ...], tuple[Point3, ...]]
    """Some places of each part, the larger one first."""
    areas: tuple[float, float]
    """Square metres of each part."""


def low_places(found: Floors, walkable: Walkable, share: float) -> list[LowPlace]:
    """Where a lower body could go on, between parts of at least `share` of the largest one."""
    reach = found.room >= LOWEST * walkable.height
    high = found.room >= walkable.height
    if not high.any() or reach.sum() == high.sum():
        return []
    places = found.stands(reach, walkable.step_height)
    room, tall = found.room[reach], np.flatnonzero(high[reach])
    part = np.full(len(room), -1)
    part[tall] = places.pick(tall).components()
    sizes = np.bincount(part[tall])
    matter = np.flatnonzero(sizes >= share * sizes.max())
    if len(matter) < 2:
        return []
    joined = _Joined(places, room)
    levels = np.unique(np.floor(room[room < walkable.height] / GRAIN).astype(int))
    first = {int(number): int(np.flatnonzero(part == number)[0]) for number in matter}
    order = sorted(first, key=lambda number: -sizes[number])
    told = list[LowPlace]()
    for k, other in enumerate(order):
        whole = joined.at(int(levels[0]))
        one = next((n for n in order[:k] if whole[first[n]] == whole[first[other]]), None)
        if one is None or len(told) >= MOST:
            continue
        best = _highest(joined, levels, first[one], first[other])
        told.append(_told(places, room, part, joined, best, (one, other), first[one]))
    return told


class _Joined:
    """Components of the places with at least some headroom, by hundredths of a metre."""

    def __init__(self, places: Stands, room: Array) -> None:
        self._places, self._room = places, room
        self._known: dict[int, Ints] = {}

    def at(self, level: int) -> Ints:
        """The component of each place; -1 where headroom is shorter. [n]"""
        if level not in self._known:
            which = np.flatnonzero(self._room >= GRAIN * level)
            number = np.full(len(self._room), -1)
            number[which] = components(self._places.links[which][:, which])[1]
            self._known[level] = number
        return self._known[level]


def _highest(joined: _Joined, levels: Ints, one: int, other: int) -> int:
    """The highest level at which two places are joined, as they are at the lowest."""
    low, high = 0, len(levels)
    while high - low > 1:
        middle = (low + high) // 2
        number = joined.at(int(levels[middle]))
        if number[one] == number[other]:
            low = middle
        else:
            high = middle
    return int(levels[low])


def _told(
    places: Stands,
    room: Array,
    part: Ints,
    joined: _Joined,
    level: int,
    pair: tuple[int, int],
    one: int,
) -> LowPlace:
    number = joined.at(level)
    x, y = places.grid.middles()
    row, column = np.divmod(places.cell, places.grid.columns)
    where = np.stack([x[column], y[row], places.z], -1)
    low = np.flatnonzero((number == number[one]) & (room < GRAIN * (level + 1)))
    middle = where[low].mean(0)
    at = where[low[np.linalg.norm(where[low] - middle, axis=1).argmin()]]
    sides = []
    for side in pair:
        mine = np.flatnonzero(part == side)
        some = mine[np.linspace(0, len(mine) - 1, SPOTS).astype(int)]
        sides.append(tuple(map(_point, where[some])))
    areas = [float((part == side).sum()) * places.grid.cell**2 for side in pair]
    return LowPlace(GRAIN * level, _point(at), (sides[0], sides[1]), (areas[0], areas[1]))


def _point(place: Array) -> Point3:
    x, y, z = place.tolist()
    return x, y, z
