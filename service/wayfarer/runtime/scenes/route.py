"""What a slot remembers of the way through its scene; the way's points are in `routes.py`."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from wayfarer.runtime.world.rows import Rows

Float = NDArray[np.float32]
Flags = NDArray[np.bool_]
Int = NDArray[np.int64]


class Passage(IntEnum):
    """Whether there is a way."""

    UNKNOWN = 0  # not looked for yet
    OPEN = 1
    CLOSED = 2  # none leads to the goal at present


@dataclass(slots=True, eq=False)
class Route(Rows):
    """The way to one goal of an agent's path; zeroed: none has been looked for."""

    passage: NDArray[np.int8]  # Passage
    revision: Int  # of the goals, and …
    waypoint: Int  # … the one that it leads to
    points: Int  # so many
    length: Float  # metres, in plan
    progress: Float  # metres of it that lie behind the agent
    doubt: Flags  # the scene has changed since: is it still clear?
    wait: Int  # steps until a way is looked for again
