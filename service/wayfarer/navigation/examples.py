"""Our own scenes, for tests, benchmarks, documents and the viewer."""

from collections.abc import Callable, Mapping
from functools import cache
from math import cos, pi, sin, tau
from typing import Final

import numpy as np

from wayfarer.navigation.scene_spec import Box, Cylinder, Floor, Ramp, Ring, SceneSpec, Solid


def rectangle(x0: float, y0: float, x1: float, y1: float) -> Ring:
    """Its four corners."""
    return (x0, y0), (x1, y0), (x1, y1), (x0, y1)


def cubes_field(seed: int = 0, boxes: int = 30, side: float = 20.0) -> SceneSpec:
    """A square field with boxes of random size and heading, like the paper's synthetic scenes."""
    random = np.random.default_rng(seed)
    solids = []
    for _ in range(boxes):
        x, y = random.uniform(1.0, side - 1.0, 2).tolist()
        width, depth = random.uniform(0.6, 2.0, 2).tolist()
        height, yaw = float(random.uniform(0.5, 2.0)), float(random.uniform(0.0, pi))
        solids.append(Box((x, y), (width, depth), height, yaw))
    return SceneSpec((Floor(rectangle(0.0, 0.0, side, side)),), tuple(solids))


def town_square() -> SceneSpec:
    """A square of 60 x 60 m: houses around it with streets between, a fountain, trees, stalls."""
    houses = [
        Box((x, y), (size, 10.0) if abs(y) > abs(x) else (10.0, size), 9.0)
        for along, size in ((-15.5, 17.0), (4.0, 14.0), (20.5, 11.0))
        for x, y in ((along, 25.0), (along, -25.0), (25.0, along), (-25.0, along))
        if max(abs(x), abs(y)) == 25.0
    ]
    fountain: list[Solid] = [Cylinder((0.0, 0.0), 3.0, 0.8), Cylinder((0.0, 0.0), 0.5, 3.0)]
    trees = [
        Cylinder((12.0 * cos(k * tau / 12), 12.0 * sin(k * tau / 12)), 0.25, 5.0) for k in range(12)
    ]
    stalls = [
        Box((8.0 * cos(a), 8.0 * sin(a)), (2.4, 1.2), 2.2, a + pi / 2)
        for a in (pi / 8 + k * tau / 8 for k in range(8))
    ]
    benches = [
        Box((16.0 * cos(a), 16.0 * sin(a)), (1.8, 0.5), 0.5, a + pi / 2)
        for a in (pi / 5 + k * tau / 10 for k in range(10))
    ]
    ground = Floor(rectangle(-30.0, -30.0, 30.0, 30.0))
    return SceneSpec((ground,), (*fountain, *houses, *trees, *stalls, *benches))


ROOMS: Final = 4
_LENGTH, _HALF, _DEPTH, _WALL, _DOOR = 24.0, 1.25, 4.0, 0.15, 1.0


def corridor() -> SceneSpec:
    """A corridor of 24 x 2.5 m with four rooms on either side, their doorways open."""
    width = _LENGTH / ROOMS
    stretch = (width - _DOOR) / 2
    beside_doors = [
        Box((room * width + along, side * (_HALF + _WALL / 2)), (stretch, _WALL), 2.6)
        for side in (-1.0, 1.0)
        for room in range(ROOMS)
        for along in (stretch / 2, width - stretch / 2)
    ]
    between_rooms = [
        Box((room * width, side * (_HALF + _WALL + _DEPTH / 2)), (_WALL, _DEPTH), 2.6)
        for side in (-1.0, 1.0)
        for room in range(1, ROOMS)
    ]
    reach = _HALF + _WALL + _DEPTH
    ground = Floor(rectangle(0.0, -reach, _LENGTH, reach))
    return SceneSpec((ground,), (*beside_doors, *between_rooms))


def corridor_doors() -> Mapping[str, Box]:
    """The doors of `corridor` as obstacles to `put` and `remove`, by name."""
    width = _LENGTH / ROOMS
    return {
        f"door {'south' if side < 0 else 'north'} {room + 1}": Box(
            ((room + 0.5) * width, side * (_HALF + _WALL / 2)), (_DOOR, 0.06), 2.1
        )
        for side in (-1.0, 1.0)
        for room in range(ROOMS)
    }


PLATFORM: Final = 1.2
"""Height of the platform of `slope_with_steps`, metres."""
STEPS: Final = 6
_TREAD: Final = 0.35


def slope_with_steps() -> SceneSpec:
    """A platform with a slope of 11° up to it and steps of 20 cm down from it."""
    rise = PLATFORM / STEPS
    steps = [
        Box((10.0, 13.0 + (k + 0.5) * _TREAD), (3.0, _TREAD), PLATFORM - (k + 1) * rise)
        for k in range(STEPS - 1)
    ]
    solids: tuple[Solid, ...] = (
        Ramp((10.0, 6.0), (3.0, 6.0), PLATFORM),
        Box((10.0, 11.0), (6.0, 4.0), PLATFORM),
        *steps,
        Box((5.0, 6.0), (1.0, 4.0), 1.5, 0.3),
        Cylinder((15.0, 6.0), 0.8, 1.8),
    )
    return SceneSpec((Floor(rectangle(0.0, 0.0, 20.0, 20.0)),), solids)


def two_storeys() -> SceneSpec:
    """A gallery 3 m up, reached by stairs of 15 steps, above a hall that one can walk under it."""
    stairs = [
        Box((2.0 + (k + 0.5) * 0.3, 1.0), (0.3, 1.6), (k + 1) * 0.2, bottom=0.0) for k in range(14)
    ]
    gallery = Box((9.1, 4.0), (5.8, 8.0), 0.2, bottom=2.8)
    return SceneSpec((Floor(rectangle(0.0, 0.0, 12.0, 8.0)),), (*stairs, gallery))


EXAMPLES: Final[Mapping[str, Callable[[], SceneSpec]]] = {
    "cubes_field": cubes_field,
    "town_square": town_square,
    "corridor": corridor,
    "slope_with_steps": slope_with_steps,
    "two_storeys": two_storeys,
}
"""Makers of the example scenes, by name."""


def is_example(spec: SceneSpec) -> bool:
    """Whether a scene has the content of an example, under any name."""
    return spec.content_hash in _hashes()


@cache
def _hashes() -> frozenset[str]:
    return frozenset(make().content_hash for make in EXAMPLES.values())
