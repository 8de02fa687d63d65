"""What avoidance knows of people: columns, one row for each agent of a session."""

from dataclasses import dataclass
from typing import Annotated

from wayfarer.world.rows import Flags, Float, Int, Rows, Shape


@dataclass(slots=True, eq=False)
class Memory(Rows):
    """What avoidance remembers of a person from step to step; all zero at first."""

    preferred: Annotated[Float, Shape(2)]  # m/s: where it would have gone
    chosen: Annotated[Float, Shape(2)]  # m/s: where it went
    waited: Float  # seconds for which it has not got on, though it would
    yields: Float  # seconds for which it still makes way for others
    retreat: Annotated[Float, Shape(2)]  # unit vector in which it makes way


@dataclass(slots=True, eq=False)
class Aims(Rows):
    """Where a person goes among others, from step to step; all zero at first."""

    wants: Flags  # it has a way to go: a goal that it has not reached
    asked: Annotated[Float, Shape(2)]  # metres: the goal that it was given …
    spot: Annotated[Float, Shape(2)]  # … and where it will stand: there, or beside others
    barred: Float  # seconds for which people who stand have closed its way


@dataclass(slots=True, eq=False)
class People(Rows):
    """Everybody of a session at one moment, on the floor."""

    number: Int  # never changes; of two who block each other the lower one goes first
    group: Int  # those of one group walk close together; 0: of none
    position: Annotated[Float, Shape(2)]  # metres
    height: Float  # metres, of the hips: it tells storeys apart
    velocity: Annotated[Float, Shape(2)]  # m/s
    walks: Flags  # it has a way to go and avoids others, so half of the task is its own
    radius: Float  # metres
    memory: Memory
    aims: Aims
