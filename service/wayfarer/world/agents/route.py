"""A slot's columns of the way through its scene; the way's points are in `routes.py`."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from wayfarer.world.rows import Flags, Float, Int, Int8, Rows


class Passage(IntEnum):
    """Whether there is a way."""

    UNKNOWN = 0  # not searched yet
    OPEN = 1
    CLOSED = 2  # no way leads to the goal at present


WAY: Final = 32
"""Maximum points of a way that moves to another server; a longer one is searched again there."""


@dataclass(slots=True, eq=False)
class Route(Rows):
    """The way to one goal of an agent's path; zeroed: not searched yet."""

    passage: Int8  # Passage
    revision: Int  # of the goals
    waypoint: Int  # the goal to which it leads
    points: Int  # number of points
    length: Float  # metres, in plan
    progress: Float  # metres of it behind the agent
    doubt: Flags  # whether the scene has changed since, so that it may no longer be clear
    wait: Int  # steps until the next search
