"""Obstacles near a body, as inputs of the candidate search: see `StepInputs.obstacles`."""

from functools import cache
from typing import Final

import numpy as np

from wayfarer.engines.engine import Float
from wayfarer.navigation.scene import Scene
from wayfarer.process.compiled import compiled, warm
from wayfarer.world.output.turns import apart
from wayfarer.world.rows import Array, Index
from wayfarer.world.scenes.cells import Cells, beside, cells_of
from wayfarer.world.scenes.people import Gathering

PROBES: Final = np.array([[0.1, 0.35], [0.1, -0.35], [0.6, 0.35], [0.6, -0.35]])
"""Metres ahead and to the left of the hips at which the nearest wall is looked for."""

STRETCH: Final = 0.3
"""Metres of wall to either side of its nearest point."""

NEAR: Final = 1.2
"""Metres from a probe beyond which walls are ignored."""

PERSON: Final = 0.2
"""Radius of a person's trunk in metres."""

PEOPLE_NEAR: Final = 2.0
"""Metres beyond which people are ignored."""


def nearest_walls(scene: Scene, hips: Array, velocity: Array, floors: Array, count: int) -> Float:
    """Stretches of wall [A, count, 7] on both sides of agents, and on both sides ahead of them.

    hips, velocity [A, 2]; floors [A]: heights that identify the storey.
    """
    speed = np.linalg.norm(velocity, axis=-1, keepdims=True)
    ahead = np.where(speed > 0, velocity / np.maximum(speed, 1e-6), (0.0, 1.0))
    left = np.stack([-ahead[:, 1], ahead[:, 0]], -1)
    probes = (
        hips[:, None] + PROBES[:count, :1] * ahead[:, None] + PROBES[:count, 1:] * left[:, None]
    )
    heights = np.broadcast_to(floors[:, None, None], (*probes.shape[:2], 1))
    distance, away = scene.clearance(np.concatenate([probes, heights], -1))
    length = np.linalg.norm(away, axis=-1)
    away = away / np.maximum(length, 1e-6)[..., None]
    wall = probes - distance[..., None] * away
    along = STRETCH * np.stack([-away[..., 1], away[..., 0]], -1)
    found = np.zeros((*probes.shape[:2], 7), np.float32)
    found[..., 0:2], found[..., 2:4] = wall - along, wall + along
    # Between two walls the field has a ridge, where it does not define their directions.
    found[..., 6] = np.where((distance < NEAR) & (length > 0.7), 0.0, -1.0)
    return found


def nearest_people(crowd: Gathering, slots: Index, places: Index, count: int, found: Float) -> None:
    """Writes the nearest others of some slots [A], in their present motion, into the last `count`
    of each of `places` [A] of `found` [B, O, 7], as far as there are any.
    """
    them, me = crowd.people, crowd.places[slots]
    moving = them.position, them.velocity
    _nearest(crowd.own[0], crowd.cells, moving, me, places, count, found)


@compiled
def _nearest(
    first: Index,
    cells: Cells,
    moving: tuple[Float, Float],
    rows: Index,
    places: Index,
    count: int,
    found: Float,
) -> None:
    position, velocity = moving
    gaps, near = np.empty(count, np.float32), np.empty(count, np.int64)
    for row in range(len(rows)):
        me, known = rows[row], 0
        for side in range(-1, 2):
            begin, end = beside(cells, first[me], position[me, 0], position[me, 1], side)
            for k in range(begin, end):
                other = cells.rows[k]
                gap = apart(position, other, position, me)
                if other == me or gap >= PEOPLE_NEAR or (known == count and gap > gaps[count - 1]):
                    continue
                at = known  # of equally near ones the lower row is the first
                while at > 0 and (gap, other) < (gaps[at - 1], near[at - 1]):
                    at -= 1
                    if at + 1 < count:
                        gaps[at + 1], near[at + 1] = gaps[at], near[at]
                if at < count:
                    gaps[at], near[at] = gap, other
                    known = min(known + 1, count)
        for at in range(known):
            into = found[places[row], found.shape[1] - count + at]
            for k in range(2):
                into[k] = into[2 + k] = position[near[at], k]
                into[4 + k] = velocity[near[at], k]
            into[6] = PERSON


@cache
def prepare() -> None:
    """Compiles the rule, or loads it, before agents walk."""
    row, place = np.zeros(1, np.int64), np.zeros((1, 2), np.float32)
    found = np.zeros((1, 2, 7), np.float32)
    warm(_nearest, row, cells_of(row, place), (place, place), row, row, 1, found)
