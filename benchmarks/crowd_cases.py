"""Cases of people among people: their starts, their goals, and the solids around them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import atan2, pi

import numpy as np
import shapely
from numpy.typing import NDArray

from wayfarer.navigation.scene_spec import Box, Floor, SceneSpec
from wayfarer.navigation.solids import floor_polygon, footprint
from wayfarer.world.agents.goal import Goal

Array = NDArray[np.float64]

SPEED = 1.2
"""Preferred speed of all people, m/s."""

WALL = 0.2
"""Metres: thickness of the wall that has the door."""

JITTER = 0.08
"""Metres by which a seed moves the starts, either way."""


@dataclass(frozen=True)
class Case:
    """People with goals; people without one stand. World space: metres, +Y is forward."""

    name: str
    spec: SceneSpec | None  # None: the flat floor without a scene
    starts: Array  # [N, 2]
    headings: Array  # [N]
    goals: tuple[Goal | None, ...]
    seconds: float  # after which it is over
    door: float | None = None  # metres: width of an opening in the line y = 0
    stream: float | None = None  # metres: width of a corridor along y in which all walk one way
    peer: bool = True  # JuPedSim can run it, too
    measures_skin: bool = False  # how deep skin is in walls, and bodies are in each other
    standing: tuple[int, ...] = field(default=())  # numbers of the people without a goal

    @property
    def ground(self) -> shapely.Geometry:
        """The ground without its walls, from above."""
        if self.spec is None:
            low, high = self.starts.min(0) - 15, self.starts.max(0) + 15
            return shapely.box(*low, *high)
        solids = shapely.union_all([footprint(solid) for solid in self.spec.solids])
        return shapely.union_all([floor_polygon(f) for f in self.spec.floors]).difference(solids)


def case(
    name: str,
    spec: SceneSpec | None,
    people: list[tuple[Array, Array | None]],
    seconds: float,
    seed: int,
    radius: float = 0.3,
    **more: object,
) -> Case:
    """`people`: starts, each with a goal or None. People with a goal face it."""
    random = np.random.default_rng(seed)
    starts = np.array([start for start, _ in people], float)
    moves = np.array([goal is not None for _, goal in people])
    shifts = random.uniform(-JITTER, JITTER, starts.shape)
    starts += shifts * (moves[:, None] if moves.any() else 1)
    ways = [
        (0, -1) if goal is None else goal - s for s, (_, goal) in zip(starts, people, strict=True)
    ]
    return Case(
        name=name,
        spec=spec,
        starts=starts,
        headings=np.array([atan2(-x, y) for x, y in ways]),
        goals=tuple(
            None if goal is None else Goal((*map(float, goal), 0.0), radius=radius, speed=SPEED)
            for _, goal in people
        ),
        seconds=seconds,
        standing=tuple(np.flatnonzero(~moves).tolist()),
        **more,  # type: ignore[arg-type]
    )


def room(width: float, length: float, *solids: Box) -> SceneSpec:
    """A floor around the origin, its edges being walls."""
    x, y = width / 2, length / 2
    return SceneSpec(floors=(Floor(((-x, -y), (x, -y), (x, y), (-x, y))),), solids=solids)


def wall_with_door(width: float, door: float) -> tuple[Box, Box]:
    """A wall along y = 0 across a room of that width, with a door in its middle."""
    side = (width - door) / 2
    return tuple(  # type: ignore[return-value]
        Box((sign * (door / 2 + side / 2), 0.0), (side, WALL), 3.0) for sign in (-1, 1)
    )


def rows(count: int, first: float, apart: float = 0.9, width: int = 8) -> list[Array]:
    """Places in rows of eight from y = `first` outwards."""
    sign = np.sign(first)
    across = (np.arange(width) - (width - 1) / 2) * apart
    return [
        np.array([across[k % width], first + sign * apart * (k // width)]) for k in range(count)
    ]


# Doors


def opposite(places: list[Array]) -> list[tuple[Array, Array]]:
    """Each person goes to a place behind the line y = 0; people in front go farthest."""
    depth = 2 * 3.0 + max(abs(y) for _, y in places) - 3.0
    return [
        (place, np.array([place[0], -np.sign(place[1]) * (depth - abs(place[1]))]))
        for place in places
    ]


def one_way(door: float, seed: int) -> Case:
    """40 people go through a door to the places opposite."""
    people = opposite(rows(40, -3.0))
    spec = room(12, 16, *wall_with_door(12, door))
    return case(f"40 one way, door {door} m", spec, people, 60, seed, door=door)


def two_ways(door: float, seed: int) -> Case:
    """20 people on either side go to the places opposite."""
    people = opposite(rows(20, -3.0) + rows(20, 3.0))
    spec = room(12, 16, *wall_with_door(12, door))
    return case(f"20 each way, door {door} m", spec, people, 120, seed, door=door)


# Shared goals


def one_goal(count: int, radius: float, seed: int) -> Case:
    """People side by side are sent to one place."""
    starts = [np.array([k - (count - 1) / 2, -6.0]) for k in range(count)]
    people = [(start, np.array([0.0, 4.0])) for start in starts]
    return case(
        f"{count} to one goal, {radius} m", room(24, 20), people, 60, seed, radius, peer=False
    )


# People in the way


def through(name: str, spec: SceneSpec, stand: list[Array], seed: int) -> Case:
    """One walks from y = -6 to y = 6, and others stand."""
    walker = (np.array([0.0, -6.0]), np.array([0.0, 6.0]))
    return case(name, spec, [walker, *((place, None) for place in stand)], 60, seed, peer=False)


def row(count: int, seed: int) -> Case:
    """A row across the way on an open floor of 24 m; shoulders .6 m apart."""
    stand = [np.array([(k - (count - 1) / 2) * 0.6, 0.0]) for k in range(count)]
    return through(f"row of {count}", room(24, 24), stand, seed)


def ring(seed: int) -> Case:
    """Twelve stand around the goal, .7 m apart."""
    radius = 0.7 / (2 * np.sin(pi / 12))
    angles = np.arange(12) * 2 * pi / 12 + pi / 12
    stand = [np.array([0.0, 6.0]) + radius * np.array([np.cos(a), np.sin(a)]) for a in angles]
    return through("ring of 12 around the goal", room(24, 24), stand, seed)


def grid(seed: int) -> Case:
    """25 across a corridor of 6 m, 1.2 m from each other."""
    across = (np.arange(5) - 2) * 1.2
    stand = [np.array([x, y]) for y in across for x in across]
    return through("grid of 25 in a corridor", room(6, 16), stand, seed)


def three_rows(seed: int) -> Case:
    """Twelve in three rows across a corridor of 4.8 m (`rows_across_a_corridor.json`)."""
    stand = [np.array([x, y]) for y in (-1.2, 0, 1.2) for x in (-1.8, -0.6, 0.6, 1.8)]
    return through("3 rows of 4 in a corridor", room(4.8, 16), stand, seed)


def blocked_corridor(seed: int) -> Case:
    """Three stand shoulder to shoulder across a corridor of 2 m."""
    stand = [np.array([x, 0.0]) for x in (-0.6, 0.0, 0.6)]
    return through("3 close a corridor of 2 m", room(2, 16), stand, seed)


# Meetings


def corridor(width: float, seed: int) -> Case:
    """Two meet in a corridor."""
    ends = np.array([0.0, 6.0])
    spec = room(width, 16)
    people = [(-ends, ends), (ends, -ends)]
    return case(f"2 meet in {width} m", spec, people, 60, seed, measures_skin=True)


def flat(count: int, seed: int) -> Case:
    """A circle of people swap places, without a scene."""
    angles = np.arange(count) * 2 * pi / count
    places = [4.0 * np.array([np.cos(a), np.sin(a)]) for a in angles]
    people = [(place, -place) for place in places]
    return case(f"{count} swap, no scene", None, people, 60, seed)


def counterflow(against: int, seed: int) -> Case:
    """RiMEA 8: 100 people in a corridor of 10 m against 0, 10, 50 or 100."""
    random = np.random.default_rng(seed)
    first = [np.array([x, y]) for y in np.linspace(-19, -8, 10) for x in np.linspace(-4, 4, 10)]
    second = [np.array([x, -y]) for x, y in first]
    others = random.permutation(len(second))[:against]
    starts = [*first, *(second[k] for k in others)]
    people = [(place, place * (1, -1)) for place in starts]
    name = f"RiMEA 8: 100 against {against}"
    return case(name, room(10, 40), people, 150, seed)


def bottleneck(seed: int) -> Case:
    """RiMEA 12 with one bottleneck: a room of 10 m, then a corridor of 1 m and 5 m."""
    sides = [Box((sign * 2.75, 2.5), (4.5, 5.0), 3.0) for sign in (-1, 1)]
    starts = [np.array([x, y]) for y in np.linspace(-9, -3, 8) for x in np.linspace(-4, 4, 9)]
    people = [(place, place * (1, 0) + (0, 15 + place[1] * 0.8)) for place in starts[:50]]
    return case("RiMEA 12: bottleneck 1 m", room(10, 32, *sides), people, 150, seed, door=1.0)


def corner(seed: int) -> Case:
    """RiMEA 6: 20 people around the corner of a corridor of 2 m; people in front go farthest."""
    floor = Floor(((0, -10), (2, -10), (2, 0), (10, 0), (10, 2), (0, 2)))
    starts = [np.array([0.5 + 0.5 * (k % 3), -9.5 + 0.8 * (k // 3)]) for k in range(20)]
    people = [
        (start, np.array([5.1 + 0.7 * (k // 3), 0.5 + 0.5 * (k % 3)]))
        for k, start in enumerate(starts)
    ]
    return case("RiMEA 6: corner, 20", SceneSpec(floors=(floor,)), people, 90, seed)


def square(count: int, seed: int) -> Case:
    """Each person in a yard of 20 × 20 m goes to the place of another one."""
    random = np.random.default_rng(seed)
    cells = random.permutation(20 * 20)[:count]
    places = np.stack([cells % 20 - 9.5, cells // 20 - 9.5], -1) * 0.94
    people = list(zip(places, places[random.permutation(count)], strict=True))
    return case(f"{count} in a yard of 20 m", room(20, 20), people, 120, seed)


def dense(density: float, seed: int) -> Case:
    """`square`, in a smaller yard: 100 people, `density` per m²."""
    random, side = np.random.default_rng(seed), (100 / density) ** 0.5
    cells = (np.arange(10) - 4.5) * side / 10
    places = np.array([(x, y) for y in cells for x in cells])
    people = list(zip(places, places[random.permutation(100)], strict=True))
    return case(f"100 in a yard, {density:g} per m²", room(side, side), people, 20, seed)


def stream(density: float, seed: int) -> Case:
    """96 people, `density` per m², fill a corridor of 4 m, and all walk 30 m along it."""
    width, across = 4.0, round(4.0 * density**0.5)
    apart = across / (width * density)
    x = (np.arange(across) - (across - 1) / 2) * width / across
    starts = [np.array([x[k % across], -apart * (k // across) - 1]) for k in range(96)]
    long = 2 * (apart * (96 // across) + 32)
    people = [(start, start + np.array([0, 30])) for start in starts]
    name = f"one way, {density:g} per m²"
    return case(name, room(width, long), people, 10, seed, stream=width)


Make = Callable[[int], Case]

CASES: dict[str, Make] = {
    "one_way_0.9": lambda seed: one_way(0.9, seed),
    "one_way_1.2": lambda seed: one_way(1.2, seed),
    "one_way_1.5": lambda seed: one_way(1.5, seed),
    "two_ways_0.9": lambda seed: two_ways(0.9, seed),
    "two_ways_1.2": lambda seed: two_ways(1.2, seed),
    "two_ways_1.5": lambda seed: two_ways(1.5, seed),
    "one_goal_4": lambda seed: one_goal(4, 0.3, seed),
    "one_goal_6": lambda seed: one_goal(6, 0.3, seed),
    "one_goal_12": lambda seed: one_goal(12, 0.3, seed),
    "one_goal_5_wide": lambda seed: one_goal(5, 1.0, seed),
    "row_5": lambda seed: row(5, seed),
    "row_11": lambda seed: row(11, seed),
    "ring": ring,
    "grid": grid,
    "three_rows": three_rows,
    "blocked": blocked_corridor,
    "corridor_0.95": lambda seed: corridor(0.95, seed),
    "corridor_1.2": lambda seed: corridor(1.2, seed),
    "corridor_1.55": lambda seed: corridor(1.55, seed),
    "flat_2": lambda seed: flat(2, seed),
    "flat_8": lambda seed: flat(8, seed),
    "corner": corner,
    "bottleneck": bottleneck,
    "counter_0": lambda seed: counterflow(0, seed),
    "counter_10": lambda seed: counterflow(10, seed),
    "counter_50": lambda seed: counterflow(50, seed),
    "counter_100": lambda seed: counterflow(100, seed),
    "square_60": lambda seed: square(60, seed),
    "square_200": lambda seed: square(200, seed),
    "dense_0.5": lambda seed: dense(0.5, seed),
    "dense_1": lambda seed: dense(1.0, seed),
    "dense_2": lambda seed: dense(2.0, seed),
    "dense_3": lambda seed: dense(3.0, seed),
    "stream_0.5": lambda seed: stream(0.5, seed),
    "stream_1": lambda seed: stream(1.0, seed),
    "stream_2": lambda seed: stream(2.0, seed),
    "stream_3": lambda seed: stream(3.0, seed),
}

QUICK = ("one_way_1.2", "two_ways_1.2", "one_goal_6", "row_5", "three_rows", "blocked", "flat_2")
