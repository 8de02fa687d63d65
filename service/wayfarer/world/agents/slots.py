"""The persistent rows of agents: columns with a free list. World space.

A slot's motion is held twice: *committed*, where it stands after the frames already sent, and
*planned*, after all frames generated. A replan copies committed over planned.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

import numpy as np

from wayfarer.errors import ResourceExhausted
from wayfarer.spec import BETAS, MARKERS, POSED_JOINTS, SEED_FRAMES
from wayfarer.world.agents.agent import AgentState
from wayfarer.world.agents.route import Route
from wayfarer.world.agents.style import Style
from wayfarer.world.avoidance.people import Aims, Memory
from wayfarer.world.output.ground import Footing
from wayfarer.world.output.legs import Legs
from wayfarer.world.rows import Flags, Float, Int, Int8, Object, Rows, Shape, UInt64


class Mode(IntEnum):
    """`AgentState` as a number in arrays."""

    STANDING = 0
    WALKING = 1
    STOPPING = 2
    TURNING = 3
    STRAFING = 4

    @property
    def state(self) -> AgentState:
        """The public name."""
        return AgentState.WALKING if self is Mode.STRAFING else AgentState[self.name]


class Feeding(IntEnum):
    """When an agent's behaviour is asked for goals; see behaviours/runner.py."""

    NONE = 0
    AT_END = 1  # when it is on the way to the last one of its path
    EACH_STEP = 2


@dataclass(slots=True)
class Seeds(Rows):
    """The two frames from which the next primitive starts."""

    markers: Annotated[Float, Shape(SEED_FRAMES, MARKERS, 3)]
    translation: Annotated[Float, Shape(SEED_FRAMES, 3)]  # hips joint
    rotations: Annotated[Float, Shape(SEED_FRAMES, POSED_JOINTS, 4)]


@dataclass(slots=True)
class Gait(Rows):
    """Steering's memory of an agent from step to step."""

    mode: Int8  # Mode
    speed: Float  # m/s, horizontal, mean over the last step
    slow_seconds: Float  # how long it has been slow while stopping, and then standing
    stop_place: Annotated[Float, Shape(2)]  # where it stopped, or will stop
    stop_facing: Annotated[Float, Shape(2)]  # unit vector that it faced then
    arrived: Flags  # the goal has been reached
    waypoint: Int  # place of that goal in the path
    trim: Float  # share by which the requested speed exceeds the goal's
    rested: Flags  # it stood when this step began


@dataclass(slots=True)
class Motion(Rows):
    """An agent's state between two steps."""

    seed: Seeds
    gait: Gait
    memory: Memory  # of avoiding others
    aims: Aims  # among others


@dataclass(slots=True)
class Slots(Rows):
    """All columns of a slot. Frames count at 40 per second."""

    active: Flags
    agent_id: Object
    alias: Int
    session: Int  # number; see registry.py
    gender: Int8  # index into spec.GENDERS
    model: Int  # number of the model that moves it; see models.py
    noise_seed: UInt64
    style: Style  # drawn from that
    betas: Annotated[Float, Shape(BETAS)]
    goal_revision: Int  # counts the changes of its goals
    revised_chunk: Int  # seq of the first chunk to which its present path applies
    feeding: Int8  # Feeding
    near_since: Int  # planned chunks when it came near the goal it wanders to; 0: it is not near
    group: Int  # agents of one session and group walk together; 0: it walks alone
    committed: Motion
    planned: Motion
    start_frame: Int  # world frame of the agent's frame 0
    planned_chunks: Int  # = seq of the next chunk to plan
    sent_chunks: Int  # = seq of the next chunk to send
    engine_call: Int  # number of the engine call that makes its next chunk; 0: none
    replanned: Flags  # the next chunk replaces a discarded one
    held: Flags  # the last chunk planned was made without the engine
    coasted: Flags  # its walk was made without the engine, too; see coasting.py
    frozen: Flags  # it is moving to another server, so nothing more is planned for it
    foot_lock: Flags  # whether its feet are locked
    legs: Legs
    scene: Int  # number of the scene that it is in; 0: none
    avoids: Flags  # whether it avoids the others of its session
    route: Route
    footing: Footing  # after the frames already sent
    sight: Int8  # Sight


class SlotTable:
    """`Slots` with a free list; doubles its capacity up to a limit."""

    def __init__(self, limit: int, capacity: int = 16) -> None:
        self.limit = limit
        self.rows = Slots.empty(min(capacity, limit))
        self._blank = Slots.empty(1)
        self._free = list(range(self.capacity))[::-1]

    @property
    def capacity(self) -> int:
        """Number of slots that exist now."""
        return len(self.rows.active)

    @property
    def free(self) -> int:
        """Number of slots that could still be acquired."""
        return self.limit - self.capacity + len(self._free)

    def acquire(self, count: int) -> list[int]:
        """Acquires zeroed slots. Raises ResourceExhausted, and then acquires none."""
        if count > self.free:
            raise ResourceExhausted(
                f"{self.free} of {self.limit} agent slots are free, not {count}"
            )
        while len(self._free) < count:
            self._grow()
        taken = [self._free.pop() for _ in range(count)]
        rows = np.array(taken, np.int64)
        self.rows.put(rows, self._blank)
        self.rows.active[rows] = True
        return taken

    def release(self, slot: int) -> None:
        """Releases a slot."""
        self.rows.active[slot] = False
        self.rows.engine_call[slot] = 0
        self._free.append(slot)

    def _grow(self) -> None:
        before = self.capacity
        self.rows.grow(min(2 * before, self.limit))
        self._free.extend(range(before, self.capacity)[::-1])
