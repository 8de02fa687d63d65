"""Queueing: agents line up behind a place."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, dist, sin
from typing import Annotated, ClassVar, Final, Literal

import numpy as np

from wayfarer.config.limits import Limits
from wayfarer.errors import Heading, Metres, MetresPerSecond
from wayfarer.world.agents.behaviour import (
    Agent,
    Aim,
    BehavingAgent,
    Behaviour,
    Others,
    Start,
    Vector,
)
from wayfarer.world.agents.checks import check_name
from wayfarer.world.agents.goal import MAX_HEADING, SPEED
from wayfarer.world.ranges import check_place, check_range

SPACING: Final = (0.5, 5.0)
"""Range of the spacing in metres."""

JOINS: Final = 1.2
"""Metres from the end of the line at which an agent becomes part of it."""

PAST: Final = 0.2
"""Spacings by which an agent is nearer to the head than the one ahead of it before both change."""


@dataclass(frozen=True, slots=True)
class Queue(Behaviour):
    """Lining up: the first stands at the head, the others behind it in order of arrival.

    Queues of one name are one, and the first agent in it defines its place. When an agent leaves,
    by another command or by being deleted, the agents behind it move up.
    """

    name: str
    head: tuple[float, float]  # metres, on the floor
    heading: float  # radians about +Z that waiting agents face; the line grows to the other side
    spacing: Annotated[float, SPACING] = 0.8  # metres between neighbours
    speed: Annotated[float, SPEED] = 1.2  # m/s
    kind: Literal["queue"] = "queue"

    NEEDS_OTHERS: ClassVar[bool] = True

    def check(self, start: Start, limits: Limits, where: str) -> None:
        """Implements `Behaviour`."""
        check_name(self.name, f"{where}.name", least=1)
        check_place(self.head, f"{where}.head")
        check_range([self.heading], -MAX_HEADING, MAX_HEADING, f"{where}.heading", Heading)
        check_range([self.spacing], *SPACING, f"{where}.spacing", Metres)
        check_range([self.speed], *SPEED, f"{where}.speed", MetresPerSecond)

    def update(self, actor: BehavingAgent) -> None:
        """Implements `Behaviour`."""
        first, place = actor.shared(_Lines).place_of(actor.agent, self)
        facing = -np.sin(first.heading), np.cos(first.heading)
        actor.aim(Aim(place, self.speed, facing=facing))


class _Lines:
    """The queues of a world: a line for each session and name, while an agent is in it."""

    def __init__(self, others: Others) -> None:
        self._others = others
        self._lines: dict[tuple[str, str], list[str]] = {}

    def place_of(self, agent: Agent, queue: Queue) -> tuple[Queue, Vector]:
        """The queue as its first agent defines it, and the agent's place in it.

        An agent that is not yet part of the line is on the way to its end.
        """
        line = self._present(agent.session_id, queue.name)
        first = self._queue_of(line[0]) if line else queue
        assert first is not None  # `_present` has checked it
        if agent.agent_id in line:
            number = line.index(agent.agent_id)
            if number and self._is_past(agent.agent_id, line[number - 1], first):
                line[number - 1 : number + 1] = agent.agent_id, line[number - 1]
                number -= 1
            return first, self._behind(line, number, first)
        end = self._behind(line, len(line), first)
        if self._comes_next(agent, queue.name, end):
            line.append(agent.agent_id)
            self._lines[agent.session_id, queue.name] = line
        return first, end

    def _behind(self, line: list[str], number: int, first: Queue) -> Vector:
        """Place `number`, farther back by as much as the one before it is behind its own place."""
        if number == 0:
            return queue_place(first, 0.0)
        x, y = self._place(line[number - 1])
        ahead_x, ahead_y = queue_place(first, 0.0)
        back = (x - ahead_x) * sin(first.heading) - (y - ahead_y) * cos(first.heading)
        late = back / first.spacing - (number - 1)
        return queue_place(first, number + (late if abs(late) < 1 else 0.0))

    def _is_past(self, agent_id: str, ahead: str, first: Queue) -> bool:
        """Whether an agent stands between the head and the one ahead of it, which it would keep
        from its place.
        """
        head = queue_place(first, 0.0)
        ways = [dist(self._place(name), head) for name in (agent_id, ahead)]
        return ways[0] < ways[1] - PAST * first.spacing

    def _comes_next(self, agent: Agent, name: str, end: Vector) -> bool:
        """Whether it is at the end of the line, and the nearest of the agents outside of it."""
        away = dist(self._place(agent.agent_id), end)
        if away >= JOINS:
            return False
        others = self._others.of_session(agent.session_id)
        line = self._lines.get((agent.session_id, name), [])
        coming = (
            other
            for other in self._still(others, name)
            if other != agent.agent_id and other not in line
        )
        return all(away <= dist(self._place(other), end) for other in coming)

    def _present(self, session_id: str, name: str) -> list[str]:
        """The line, without agents that have left it."""
        line = self._lines.get((session_id, name), [])
        left = list(self._still(line, name))
        if left:
            self._lines[session_id, name] = left
        else:
            self._lines.pop((session_id, name), None)
        return left

    def _still(self, line: list[str], name: str) -> Iterator[str]:
        for agent_id in line:
            queue = self._queue_of(agent_id)
            if queue is not None and queue.name == name:
                yield agent_id

    def _queue_of(self, agent_id: str) -> Queue | None:
        agent = self._others.agent(agent_id)
        doing = None if agent is None else self._others.doing(agent)
        return doing if isinstance(doing, Queue) else None

    def _place(self, agent_id: str) -> Vector:
        agent = self._others.agent(agent_id)
        assert agent is not None  # it is in a line, or in its session
        return self._others.place(agent)


def queue_place(queue: Queue, number: float) -> Vector:
    """The place of number 0, 1, 2 … of a queue, or of an agent between them."""
    back = number * queue.spacing
    return queue.head[0] + back * sin(queue.heading), queue.head[1] - back * cos(queue.heading)
