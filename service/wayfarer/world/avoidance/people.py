"""Avoidance's data about people: columns, one row for each agent of a session."""

from dataclasses import dataclass
from typing import Annotated

from wayfarer.world.rows import Flags, Float, Int, Rows, Shape


@dataclass(slots=True, eq=False)
class Memory(Rows):
    """Avoidance's memory of a person from step to step; all zero at first."""

    preferred: Annotated[Float, Shape(2)]  # m/s: the velocity that it wanted
    chosen: Annotated[Float, Shape(2)]  # m/s: the velocity that it took
    waited: Float  # seconds for which it wanted to walk on and did not, since it made way last
    yields: Float  # seconds for which it still makes way for others
    retreat: Annotated[Float, Shape(2)]  # direction in which it makes way


@dataclass(slots=True, eq=False)
class Aims(Rows):
    """A person's aims among others, from step to step; all zero at first."""

    wants: Flags  # whether it has a way to go: a goal that it has not reached
    asked: Annotated[Float, Shape(2)]  # metres: the goal that it received
    spot: Annotated[Float, Shape(2)]  # metres: where it will stand, there or next to others
    barred: Float  # seconds for which standing people have closed its way
    stuck: Float  # seconds by which it has fallen behind a slow pace since the last `BLOCKED`
    advanced: Float  # metres along its way: negative while it makes up for having gone back


@dataclass(slots=True, eq=False)
class People(Rows):
    """All people of a session at one moment, on the floor."""

    number: Int  # never changes; of two people that block each other the lower one goes first
    group: Int  # people of one group walk close together; 0: no group
    position: Annotated[Float, Shape(2)]  # metres
    height: Float  # metres, of the hips; distinguishes storeys
    velocity: Annotated[Float, Shape(2)]  # m/s
    walks: Flags  # it has a way to go and avoids others, so half of the task is its own
    radius: Float  # metres
    memory: Memory
    aims: Aims
