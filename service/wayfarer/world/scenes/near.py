"""Obstacles near a body, as inputs of the candidate search: see `StepInputs.obstacles`."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.engines.engine import Float
from wayfarer.navigation.scene import Scene
from wayfarer.world.avoidance.people import People
from wayfarer.world.rows import Index

Array = NDArray[np.floating[Any]]

PROBES: Final = np.array([[0.1, 0.35], [0.1, -0.35], [0.6, 0.35], [0.6, -0.35]])
"""Metres ahead and to the left of the hips at which the nearest wall is looked for."""

STRETCH: Final = 0.3
"""Metres of wall to either side of its nearest point."""

NEAR: Final = 1.2
"""Metres from a probe beyond which walls are ignored."""

PERSON: Final = 0.2
"""Metres: radius of a person's trunk."""

PEOPLE_NEAR: Final = 2.0
"""Metres beyond which people are ignored."""


def nearest_walls(scene: Scene, hips: Array, velocity: Array, floors: Array, count: int) -> Float:
    """Stretches of wall [A, count, 7] on both sides of agents, and on both sides ahead of them.

    hips, velocity [A, 2]; floors [A]: heights that tell the storey.
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
    # Between two walls the field has a ridge, where it does not say which way either is.
    found[..., 6] = np.where((distance < NEAR) & (length > 0.7), 0.0, -1.0)
    return found


def nearest_people(people: People, rows: Index, count: int) -> Float:
    """The nearest others [A, count, 7] of `rows` of people, moving on as they do now."""
    place = people.position
    apart = np.linalg.norm(place - place[rows, None], axis=-1)
    apart[np.arange(len(rows)), rows] = np.inf
    nearest = np.argsort(apart, axis=1, kind="stable")[:, :count]
    found = np.zeros((len(rows), count, 7), np.float32)
    found[..., 6] = -1.0
    known = nearest.shape[1]
    spots = place[nearest]
    found[:, :known, 0:2] = found[:, :known, 2:4] = spots
    found[:, :known, 4:6] = people.velocity[nearest]
    gaps = np.take_along_axis(apart, nearest, 1)
    found[:, :known, 6] = np.where(gaps < PEOPLE_NEAR, PERSON, -1.0)
    return found
