"""Events of agents, streams and the server, for subscribers."""

from dataclasses import dataclass
from enum import StrEnum

from wayfarer.errors import Metres, Place, Text


class EventKind(StrEnum):
    """Kinds of `Event`; names as in motion.proto."""

    GOAL_REACHED = "goal_reached"
    PATH_DONE = "path_done"
    GAP = "gap"
    DRAINING = "draining"
    MODEL_CHANGED = "model_changed"
    GOAL_MOVED = "goal_moved"  # it was off free ground: the nearest reachable place was taken
    UNREACHABLE = "unreachable"  # no way leads to the goal: the agent waits where it is
    BLOCKED = "blocked"  # an obstacle, or others, close the way: the agent waits until it opens
    AGENT_LEFT = "agent_left"  # an agent of a crowd has left, without a call
    BEHAVIOUR_ENDED = "behaviour_ended"  # the agent that it followed, or fled, has been deleted
    FAULT = "fault"  # an error in the server concerns the agent or, without one, the session


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to an agent, a stream or the server."""

    kind: EventKind
    at: float  # Unix seconds; for a goal, the scheduled time of its chunk
    agent_id: str = ""
    alias: int = 0
    goal_revision: int = 0
    waypoint: int = 0
    detail: str = ""  # a sentence for people, in which each {} stands for one of `parts`
    parts: tuple[Metres | Place | str, ...] = ()

    @property
    def text(self) -> Text:
        """The sentence, for writing in a basis."""
        return Text(self.detail, self.parts)
