"""Obstacles near a body, as inputs of the candidate search: see `StepInputs.obstacles`."""

from functools import cache
from typing import Final

import numpy as np

from wayfarer.engines.engine import Float
from wayfarer.navigation.scene import Scene
from wayfarer.process.compiled import compiled, warm
from wayfarer.world.avoidance.people import People
from wayfarer.world.output.turns import apart
from wayfarer.world.rows import Array, Index

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


def nearest_people(people: People, rows: Index, places: Index, count: int, found: Float) -> None:
    """Writes the nearest others of `rows` [A], in their present motion, into the last `count` of
    each of `places` [A] of `found` [B, O, 7], as far as there are any.
    """
    _nearest(people.position, people.velocity, rows, places, count, found)


@compiled
def _nearest(
    position: Float, velocity: Float, rows: Index, places: Index, count: int, found: Float
) -> None:
    gaps, first = np.empty(count, np.float32), found.shape[1] - count
    for row in range(len(rows)):
        me, near, known = rows[row], found[places[row]], 0
        for other in range(len(position)):
            gap = apart(position, other, position, me)
            if other == me or gap >= PEOPLE_NEAR or (known == count and gap >= gaps[count - 1]):
                continue
            known = min(known + 1, count)
            at = known - 1
            while at > 0 and gaps[at - 1] > gap:  # of equally near ones the lower row is the first
                gaps[at] = gaps[at - 1]
                for k in range(7):
                    near[first + at, k] = near[first + at - 1, k]
                at -= 1
            gaps[at] = gap
            for k in range(2):
                near[first + at, k] = near[first + at, 2 + k] = position[other, k]
                near[first + at, 4 + k] = velocity[other, k]
            near[first + at, 6] = PERSON


@cache
def prepare() -> None:
    """Compiles the rule, or loads it, before agents walk."""
    row, place = np.zeros(1, np.int64), np.zeros((1, 2), np.float32)
    warm(_nearest, place, place, row, row, 1, np.zeros((1, 2, 7), np.float32))
