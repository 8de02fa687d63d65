"""Barriers between parts of the ground: too little headroom, too high a step, too steep a slope.
Their size and their places.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.algorithms import components, distances
from wayfarer.navigation.grid import Grid
from wayfarer.navigation.ground.levels import TOLERANCE, Floors, Stands, floors
from wayfarer.navigation.meshes.posture import slopes
from wayfarer.navigation.scene_spec import Point3, Walkable

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.floating[Any]]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

LOWEST: Final = 0.5
"""Ways are searched down to this share of the required headroom."""
HIGHEST: Final = 1.0
"""Ways are searched up to steps of this height, metres."""
STEEPEST: Final = 70.0
"""Ways are searched up to slopes of this angle, degrees."""
GRAIN: Final = 0.01
"""Metres."""
MOST: Final = 8
"""Maximum number of reported barriers of a kind."""
SPOTS: Final = 40
"""Number of places that stand for a part of the ground."""


class Kind(Enum):
    """The kind of a barrier."""

    HEADROOM = auto()
    SLOPE = auto()  # before steps: over the ground below a ramp there is a step to its upper end
    STEP = auto()


@dataclass(frozen=True, slots=True)
class Barrier:
    """A barrier between two parts of the ground."""

    kind: Kind
    value: float
    """Metres (degrees for a slope) on the way with the least of it."""
    excess: float
    """Its ratio to the allowed value."""
    at: Point3
    sides: tuple[tuple[Point3, ...], tuple[Point3, ...]]
    """Some places of each part, the larger one first."""
    areas: tuple[float, float]
    """Square metres of each part."""


def barriers(
    corners: Array, grid: Grid, found: Floors, walkable: Walkable, share: float
) -> list[Barrier]:
    """Barriers between parts of at least `share` of the largest. `found`: floors of the corners."""
    stood = found.room >= walkable.height
    places = found.stands(stood, walkable.step_height)
    if len(_that_matter(places.components(), share)) < 2:
        return []
    return [
        *_low(found, walkable, share),
        *_steep(corners, grid, walkable, share),
        *_high(corners, grid, stood, walkable, share),
    ]


@dataclass(frozen=True, slots=True)
class _Ways:
    """Ways through a kind of barrier: the places and links that they use, at sorted levels of
    trouble, the highest first.
    """

    kind: Kind
    places: Stands
    part: Ints  # of the ground that each place belongs to; -1: no standing room
    levels: Array
    allowed: float
    open_at: Callable[[float], tuple[Ints, "csr_array"]]
    """The places that are open at a level, and the links between them."""
    hard_at: Callable[[float], Ints]
    """Places with the trouble of a level."""

    def barriers(self, share: float) -> list[Barrier]:
        """Barriers between parts that these ways would join."""
        order = _that_matter(self.part, share)
        if not len(self.levels) or len(order) < 2:
            return []
        first = {int(number): int(np.flatnonzero(self.part == number)[0]) for number in order}
        whole, found = self._joined(0), list[Barrier]()
        for k, other in enumerate(first):
            before = list(first)[:k]
            one = next((n for n in before if whole[first[n]] == whole[first[other]]), None)
            if one is not None and len(found) < MOST:
                found.append(self._between(one, other, first))
        return found

    def _joined(self, level: int) -> Ints:
        """The component of each place; -1: it is closed. [n]"""
        which, links = self.open_at(float(self.levels[level]))
        number = np.full(len(self.part), -1)
        number[which] = components(links)[1]
        return number

    def _between(self, one: int, other: int, first: dict[int, int]) -> Barrier:
        low, high = 0, len(self.levels)
        while high - low > 1:
            middle = (low + high) // 2
            number = self._joined(middle)
            if number[first[one]] == number[first[other]]:
                low = middle
            else:
                high = middle
        value = float(self.levels[low])
        number = self._joined(low)
        hard = self.hard_at(value)
        hard = hard[number[hard] == number[first[one]]]
        where = self._where()
        sides = [where[self.part == side] for side in (one, other)]
        # of several equally hard ones, the one in the middle
        away = distances(where[hard], sides[0]) + distances(where[hard], sides[1])
        near = where[hard[away <= away.min() + 2 * self.places.grid.cell]]
        at = near[np.linalg.norm(near - near.mean(0), axis=1).argmin()]
        spots = [side[np.linspace(0, len(side) - 1, SPOTS).astype(int)] for side in sides]
        areas = [len(side) * self.places.grid.cell**2 for side in sides]
        ratio = value / self.allowed
        return Barrier(
            self.kind,
            value,
            1 / ratio if self.kind is Kind.HEADROOM else ratio,
            _point(at),
            (tuple(map(_point, spots[0])), tuple(map(_point, spots[1]))),
            (areas[0], areas[1]),
        )

    def _where(self) -> Array:
        """[n, 3]"""
        x, y = self.places.grid.middles()
        row, column = np.divmod(self.places.cell, self.places.grid.columns)
        return np.stack([x[column], y[row], self.places.z], -1)


def _low(found: Floors, walkable: Walkable, share: float) -> list[Barrier]:
    """Ways that a lower body could take."""
    reach = found.room >= LOWEST * walkable.height
    places, room = found.stands(reach, walkable.step_height), found.room[reach]
    levels = np.unique(np.floor(room[room < walkable.height] / GRAIN)) * GRAIN
    return _Ways(
        Kind.HEADROOM,
        places,
        _parts(places, room >= walkable.height),
        levels,
        walkable.height,
        open_at=lambda level: _picked(places, room >= level),
        hard_at=lambda level: np.flatnonzero(room < level + GRAIN),
    ).barriers(share)


def _steep(corners: Array, grid: Grid, walkable: Walkable, share: float) -> list[Barrier]:
    """Ways that a climber could take."""
    angle = slopes(corners)
    if not ((angle > walkable.slope_deg) & (angle <= STEEPEST)).any():
        return []
    found = floors(corners, grid, replace(walkable, slope_deg=STEEPEST))
    free = found.room >= walkable.height
    # between cells of a coarse grid, a slope rises by more than a step
    step = max(walkable.step_height, grid.cell * float(np.tan(np.radians(STEEPEST))))
    places, slope = found.stands(free, step), angle[found.triangle[free]]
    levels = np.unique(np.ceil(slope[slope > walkable.slope_deg] - 1e-6))
    return _Ways(
        Kind.SLOPE,
        places,
        _parts(found.stands(free, walkable.step_height), slope <= walkable.slope_deg),
        levels[::-1],
        walkable.slope_deg,
        open_at=lambda level: _picked(places, slope <= level + 1e-6),
        hard_at=lambda level: np.flatnonzero(slope > level - 1),
    ).barriers(share)


def _high(
    corners: Array, grid: Grid, stood: Mask, walkable: Walkable, share: float
) -> list[Barrier]:
    """Ways that a body with longer legs could take. `stood`: floors where one can stand."""
    from scipy.sparse import csr_array

    # the sides of a step that can be taken are no walls
    found = floors(corners, grid, replace(walkable, step_height=HIGHEST))
    free = found.room >= walkable.height
    places = found.stands(free, HIGHEST)
    pairs = places.links.tocoo()
    rise = np.abs(places.z[pairs.row] - places.z[pairs.col])
    every = np.arange(len(places.z))

    def below(level: float) -> "csr_array":
        some = rise <= level + TOLERANCE
        ends = (pairs.row[some], pairs.col[some])
        return csr_array((np.ones(len(ends[0]), bool), ends), shape=pairs.shape)

    levels = np.unique(np.ceil(rise[rise > walkable.step_height + TOLERANCE] / GRAIN - 0.1))
    return _Ways(
        Kind.STEP,
        places,
        _parts(found.stands(free, walkable.step_height), stood[free]),
        levels[::-1] * GRAIN,
        walkable.step_height,
        open_at=lambda level: (every, below(level)),
        hard_at=lambda level: np.unique(pairs.row[np.abs(rise - level) <= GRAIN]),
    ).barriers(share)


def _picked(places: Stands, which: Mask) -> tuple[Ints, "csr_array"]:
    number = np.flatnonzero(which)
    return number, places.pick(number).links


def _parts(places: Stands, which: Mask) -> Ints:
    """The component of each selected place; -1 for others. [n]"""
    number, links = _picked(places, which)
    part = np.full(len(which), -1)
    part[number] = components(links)[1]
    return part


def _that_matter(part: Ints, share: float) -> Ints:
    """The numbers of the large parts, the largest first."""
    sizes = np.bincount(part[part >= 0])
    matter = np.flatnonzero(sizes >= share * sizes.max(initial=1))
    return matter[np.argsort(-sizes[matter], kind="stable")]


def _point(place: Array) -> Point3:
    x, y, z = place.tolist()
    return x, y, z
