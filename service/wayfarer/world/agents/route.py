"""A slot's columns of the way through its scene; the way's points are in `routes.py`."""

from dataclasses import dataclass
from enum import IntEnum

from wayfarer.world.rows import Flags, Float, Int, Int8, Rows


class Passage(IntEnum):
    """Whether there is a way."""

    UNKNOWN = 0  # not looked for yet
    OPEN = 1
    CLOSED = 2  # none leads to the goal at present


@dataclass(slots=True, eq=False)
class Route(Rows):
    """The way to one goal of an agent's path; zeroed: none has been looked for."""

    passage: Int8  # Passage
    revision: Int  # of the goals, and …
    waypoint: Int  # … the one that it leads to
    points: Int  # number of points
    length: Float  # metres, in plan
    progress: Float  # metres of it that lie behind the agent
    doubt: Flags  # the scene has changed since: is it still clear?
    wait: Int  # steps until a way is looked for again
