"""Everything about avoidance that is tuned: metres, seconds, m/s."""

from dataclasses import dataclass
from math import cos, hypot, radians, sin
from typing import Final

import numpy as np

TURNS: Final = (0, 12, -12, 25, -25, 40, -40, 60, -60, 85, -85, 120, -120, 160)
"""Degrees from the preferred direction that are tried, anticlockwise."""
SPEEDS: Final = (1.0, 0.6)
"""Shares of the preferred speed that are tried."""

FAN: Final = np.array(
    [(s * cos(radians(a)), s * sin(radians(a))) for s in SPEEDS for a in TURNS], np.float32
)
"""The candidates [F, 2], in a frame in which the preferred velocity is (1, 0)."""


@dataclass(frozen=True, slots=True)
class Rules:
    """How people avoid each other."""

    neighbours: int = 10  # of whom a person takes notice at most
    sight: float = 8.0  # metres beyond which others are ignored
    storey: float = 2.0  # metres up or down from which others are on another storey
    horizon: float = 3.5  # seconds that are looked ahead
    soon: float = 0.3  # what happens before cannot be helped
    close: float = 1.5  # nearer nobody relies on others; twice as far, on half of the task
    comfort: float = 0.35  # preferred room between two, beside their radii
    reaction: float = 0.25  # seconds until a body follows a new velocity
    slowest: float = 0.5  # m/s: nobody walks well more slowly
    wall_room: float = 0.1  # preferred between a person's radius and a wall
    wall_times: tuple[float, ...] = (0.3, 0.7, 1.2)  # at which a way is looked at for walls

    deviation: float = 2.0  # costs, of 1 m/s: not to go where one would
    change: float = 0.7  # to go elsewhere than last time
    collision: float = 2.2  # to collide (at once: ten times that)
    wall: float = 15.0  # to touch a wall

    patience: float = 1.2  # seconds of waiting until a person makes way for those before it
    yielding: float = 1.6  # seconds for which it does
    yield_speed: float = 0.6
    push: float = 4.0  # seconds of waiting until a person is content with half of that room
    least_comfort: float = 0.15  # and the room that it wants however long it waits
    beside_standing: float = 0.1  # preferred room beside an agent that stands
    stands_apart: float = 0.05  # room beside those where it stops
    hurry: float = 2.5  # seconds of waiting; after n times that it looks ahead 1/n as far
    shortest: float = 1.0  # seconds that it looks ahead at least

    opposite: float = 0.5  # cosine from which two walk against each other, or the same way
    lane: float = 0.6  # metres by which oncoming people are passed on the right
    lane_sight: float = 12.0  # metres ahead in which they are seen
    lane_wide: float = 1.8  # metres to either side of the way in which they are
    beside: float = 1.2  # metres to the right from which one person is passed on the left
    lane_soon: float = 0.5  # seconds: a lane is taken no faster, however near somebody is,
    lane_most: float = 0.8  # nor at a greater share of the speed

    @property
    def reach(self) -> float:
        """Metres within which anybody can matter."""
        return max(self.sight, hypot(self.lane_sight, self.lane_wide)) + 0.1


RULES: Final = Rules()
