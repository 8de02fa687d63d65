"""People who walk together: one slows down for those who lag behind."""

from typing import Final

import numpy as np

from wayfarer.world.avoidance.people import Float, People
from wayfarer.world.rows import Index

NEAR: Final = 6.0
"""Metres: farther away a companion is not waited for."""
LEAD: Final = 1.0
"""Metres ahead of the middle of its group from which a person slows down."""
SLOWEST: Final = 0.6
"""Share of its speed to which it slows down."""


def keep_together(people: People, rows: Index, preferred: Float) -> Float:
    """Preferred velocities [A, 2] of people at `rows`, slower for who is before its group."""
    grouped = np.flatnonzero(people.group[rows] > 0)
    if not len(grouped):
        return preferred
    mine = rows[grouped]
    way = preferred[grouped]
    unit = way / np.maximum(np.sqrt((way * way).sum(-1, keepdims=True)), 1e-6)
    apart = people.position[mine][:, None] - people.position  # [G, N, 2]
    with_me = (people.group[mine][:, None] == people.group) & ((apart * apart).sum(-1) < NEAR**2)
    middle = (apart * with_me[..., None]).sum(1) / with_me.sum(1, keepdims=True)
    ahead = (middle * unit).sum(-1)  # metres before the middle of those near
    adapted = preferred.copy()
    adapted[grouped] = way * np.clip(1 - 0.5 * (ahead - LEAD), SLOWEST, 1.0)[:, None]
    return adapted.astype(np.float32)
