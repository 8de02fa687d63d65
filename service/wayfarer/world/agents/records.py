"""Agents and sessions at rest: everything on which their motion depends, as of the last chunk sent.
Later plans are made again.

`persistence/capture.py` takes records out of a world, and `Membership.put_session` and `put_agent`
put them into one.
"""

from dataclasses import dataclass
from typing import Annotated

from wayfarer.world.agents.agent import AgentSpec, SessionSpec
from wayfarer.world.agents.behaviour import Behaviour
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.route import WAY, Route
from wayfarer.world.agents.slots import Motion
from wayfarer.world.output.ground import Footing
from wayfarer.world.rows import Double, Flags, Int, Rows, Shape


@dataclass(frozen=True, slots=True)
class AgentRecord:
    """One agent. Arrays are world space, as in slots.py; noise is drawn by seed and `seq`."""

    agent_id: str
    alias: int
    spec: AgentSpec
    created_at: float  # Unix seconds
    seq: int  # of the next chunk
    motion: Motion  # one row: the state after the last sent frame
    footing: Footing  # one row
    goal_revision: int
    path: tuple[Goal, ...]  # goals that are not yet forgotten
    passed: int  # place of the first of them in the path
    path_start: tuple[float, float]  # metres: where the way to the first of them begins
    behaviour: Behaviour | None
    part: int = 0  # of a routine
    begun: int = 0  # place in the path where the behaviour, or the part, began
    model: str = ""  # stamp of the model that moves it; empty: the default model


@dataclass(slots=True)
class LiveRows(Rows):
    """Columns of an agent that continues without a pause, in addition to its record."""

    shown_at: Double  # Unix seconds at which the next chunk is due
    replanned: Flags  # as in slots.py, as for all below
    held: Flags
    near_since: Int
    route: Route
    way: Annotated[Double, Shape(WAY, 3)]  # the points of that route
    begun_seq: Int  # of the first chunk of its behaviour, or of the part of a routine


@dataclass(frozen=True, slots=True)
class SessionRecord:
    """A session with its agents in order of creation."""

    session_id: str
    spec: SessionSpec
    created_at: float  # Unix seconds
    last_alias: int
    agents: tuple[AgentRecord, ...]
