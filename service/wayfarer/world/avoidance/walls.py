"""How far the ways that a person may take are free of walls, and what it costs to come near one."""

from math import inf
from typing import Final

import numpy as np

from wayfarer.process.compiled import compiled
from wayfarer.world.avoidance.kernel import (
    REACTION,
    TRIED,
    WALL,
    WALL_ROOM,
    WALL_SHARE,
    WALL_SLACK,
    WAY,
    Choices,
    Everybody,
)
from wayfarer.world.rows import Float, Index

SEEN: Final = TRIED * len(WAY) + 1
"""Points at which a person looks for walls: those of each way, and where it is."""


@compiled
def see_ways(everybody: Everybody, rows: Index, made: Choices, points: Float) -> None:
    """Writes the points [A, SEEN, 2] of the ways of people `rows` [A]."""
    for row in range(len(rows)):
        me = rows[row]
        for axis in range(2):
            here = everybody.position[me, axis]
            start = here + np.float32(REACTION) * everybody.velocity[me, axis]
            for k in range(TRIED):
                for step in range(len(WAY)):
                    along = made.ways[row, k, axis] * np.float32(WAY[step])
                    points[row, k * len(WAY) + step, axis] = start + along
            points[row, SEEN - 1, axis] = here


@compiled
def see_walls(everybody: Everybody, rows: Index, half: Float, room: Float, made: Choices) -> None:
    """Writes how far each way is free of walls, and what it costs, into `made`.

    `half` [A]: half the width of each person's way. `room` [A, SEEN]: metres from the points of
    `see_ways` to walls.
    """
    most = np.float32(WALL_ROOM)
    for row in range(len(rows)):
        # a person that is too near already may go wherever it is no nearer
        here, radius = room[row, SEEN - 1], everybody.radius[rows[row]]
        narrow = np.float32(WALL_SHARE) * half[row]
        wanted = min(radius + most, narrow, here)
        least = min(radius - np.float32(WALL_SLACK), narrow, here) - np.float32(1e-4)
        for k in range(TRIED):
            lack, free = np.float32(0), inf
            for step in range(len(WAY) - 1, -1, -1):
                near = room[row, k * len(WAY) + step]
                lack = max(lack, wanted - near)
                if near < least:
                    free = float(np.float32(WAY[step - 1])) if step > 0 else 0.0
            made.walls[row, k] = np.float32(WALL) * min(lack, most) / most
            made.free[row, k] = free
