"""Requests of a session's readers, and the chunks and events published to them."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from wayfarer.runtime.streams.root_tracks import Roots
from wayfarer.runtime.streams.sights import Sights
from wayfarer.world.agents.agent import NO_CHUNKS, AgentInfo, MotionChunks
from wayfarer.world.events import Event, EventKind


@dataclass(frozen=True, slots=True)
class Publication:
    """The chunks and events of one moment for a session's subscribers."""

    position: int  # 1, 2, 3 … per session
    chunks: MotionChunks = NO_CHUNKS  # that fell due together, at most one per agent
    events: tuple[Event, ...] = ()  # after the chunks
    added: tuple[AgentInfo, ...] = ()  # in clips and replays: agents whose first chunk this is
    roots: Roots | None = None  # of `chunks`, once a subscriber has asked for them

    @property
    def scheduled_at(self) -> float:
        """Time of its first chunk or event."""
        return float(self.chunks.scheduled_at[0]) if self.chunks else self.events[0].at


@dataclass(frozen=True, slots=True)
class Resume:
    """The progress of an earlier subscription to the session."""

    epoch: str  # life of the session on a server; see `Subscription.epoch`
    position: int  # of the last publication received
    same_agents: bool = True  # it followed the agents that are followed now


class SlowReader(StrEnum):
    """The treatment of chunks that wait too long for a subscriber."""

    DROP_OLDEST = "drop_oldest"
    HOLD = "hold"  # the session's agents wait, unless another subscriber reads
    DISCONNECT = "disconnect"  # end with ResourceExhausted


@dataclass(frozen=True, slots=True)
class StreamOptions:
    """A subscriber's request."""

    agent_ids: tuple[str, ...] = ()  # empty: all agents of the session, later ones too
    slow_reader: SlowReader = SlowReader.DROP_OLDEST
    resume: Resume | None = None  # of an earlier subscription to the session
    hold_s: float = 30.0  # HOLD: longest time that agents wait; the session's lease
    roots: bool = False  # whether publications must have roots
    events_only: bool = False  # it shows no agents
    sights: Sights | None = None  # of a stream with rings; None: it shows all agents in full
    pack: Callable[[MotionChunks], object] | None = None  # ahead, on the motion thread; see _pack


def model_changed(agent: AgentInfo, at: float) -> Event:
    """The event for an agent that is moved by another model, which it has already; Unix seconds."""
    return Event(
        EventKind.MODEL_CHANGED,
        at,
        agent_id=agent.agent_id,
        alias=agent.alias,
        goal_revision=agent.goal_revision,
        waypoint=agent.waypoint,
        detail=f"model {agent.model!r} moves the agent from its next primitive on",
    )
