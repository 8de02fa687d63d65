"""Goal events from chunks: a goal reached, a path done."""

from collections.abc import Callable, Iterator
from math import dist
from typing import Final

import numpy as np

from wayfarer.errors import Metres
from wayfarer.world.agents.agent import AgentInfo, AgentState, ChunkFlag, MotionChunk, MotionChunks
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.records import AgentRecord
from wayfarer.world.agents.slots import Mode
from wayfarer.world.events import Event, EventKind

ARRIVAL_MARGIN: Final = 0.3
"""Metres outside the radius of its goal beyond which an agent has stopped short of it."""

Place = tuple[int, int]  # revision, and number of a goal in that path


class GoalEvents:
    """Goal events of one session's agents."""

    def __init__(
        self,
        info: Callable[[str], AgentInfo],
        failed: Callable[[str, Exception], None],
    ) -> None:
        """`info(agent_id)` returns the agent with its present path.

        `failed(agent_id, error)`: the events of one agent are lost.
        """
        self._info = info
        self._failed = failed
        # Agents that have reached the last goal of their path and do not stand yet.
        self.stopping: dict[str, Place] = {}

    def events(self, chunks: MotionChunks) -> tuple[Event, ...]:
        """Events of the chunks that leave now, in their order."""
        arrived = chunks.flags & ChunkFlag.ARRIVED
        concerned = set(np.flatnonzero(arrived).tolist()) if arrived.any() else set()
        if self.stopping:
            concerned |= {row for row, name in enumerate(chunks.agent_id) if name in self.stopping}
        found = list[Event]()
        for row in sorted(concerned):
            try:
                found += self._of(chunks[row])
            except Exception as error:
                self._failed(chunks.agent_id[row], error)
        return tuple(found)

    def adopt(self, record: AgentRecord) -> None:
        """Adds an agent from another server, which may have reached its goal and not stand yet."""
        gait, path = record.motion.gait, record.path
        waypoint = int(gait.waypoint[0])
        is_stopping = gait.arrived[0] and gait.mode[0] != Mode.STANDING
        if is_stopping and path and path[waypoint - record.passed].stop:
            self.stopping[record.agent_id] = record.goal_revision, waypoint

    def forget(self, agent_id: str) -> None:
        """Forgets a deleted agent."""
        self.stopping.pop(agent_id, None)

    def _of(self, chunk: MotionChunk) -> Iterator[Event]:
        name = chunk.agent_id
        if chunk.flags & ChunkFlag.ARRIVED:
            yield _event(EventKind.GOAL_REACHED, chunk, *self._reached(chunk))
            last = self._last_goal(chunk)
            if last is not None and last.stop:
                self.stopping[name] = _place(chunk)
            elif last is not None:
                yield _event(EventKind.PATH_DONE, chunk, "the last goal was passed")
        if name in self.stopping:
            if self.stopping[name] != _place(chunk):  # it has received another goal since
                del self.stopping[name]
            elif chunk.state is AgentState.STANDING:
                del self.stopping[name]
                if self._last_goal(chunk) is not None:
                    yield _event(EventKind.PATH_DONE, chunk, "the agent stands at the last goal")

    def _reached(self, chunk: MotionChunk) -> tuple[str, tuple[Metres, ...]]:
        """The text for a reached goal, with the distance at which other agents kept it."""
        text, info = f"goal {chunk.waypoint} was reached", self._info(chunk.agent_id)
        if info.goal is None or _place(chunk) != (info.goal_revision, info.waypoint):
            return text, ()
        away = dist(chunk.translation[-1, :2].tolist(), info.goal.position[:2])
        if away <= info.goal.radius + ARRIVAL_MARGIN:
            return text, ()
        return text + " as nearly as others let it, {} from it", (Metres(round(away, 2)),)

    def _last_goal(self, chunk: MotionChunk) -> Goal | None:
        """The goal that a chunk was planned for, if it is the last one of the agent's path."""
        info = self._info(chunk.agent_id)
        is_last = _place(chunk) == (info.goal_revision, info.waypoints - 1)
        return info.goal if is_last else None


def _place(chunk: MotionChunk) -> Place:
    return chunk.goal_revision, chunk.waypoint


def _event(
    kind: EventKind, chunk: MotionChunk, detail: str, parts: tuple[Metres, ...] = ()
) -> Event:
    return Event(
        kind,
        chunk.scheduled_at,
        chunk.agent_id,
        chunk.alias,
        chunk.goal_revision,
        chunk.waypoint,
        detail,
        parts,
    )
