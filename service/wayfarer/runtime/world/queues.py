"""Lines of agents who queue."""

from collections.abc import Callable, Iterator
from math import cos, dist, sin
from typing import Final

from wayfarer.runtime.behaviours import Queue
from wayfarer.runtime.crowd.behaviours import Vector, queue_place
from wayfarer.runtime.world.registry import Agent, Registry

JOINS: Final = 1.2
"""Metres from the end of the line at which an agent becomes part of it."""


class Queues:
    """Who stands where: a line for each session and name, as long as somebody is in it."""

    def __init__(
        self,
        registry: Registry,
        doing: Callable[[Agent], object],
        place: Callable[[Agent], Vector],
    ) -> None:
        """`doing` and `place`: what an agent does now, and where it is."""
        self._registry = registry
        self._doing = doing
        self._place = place
        self._lines: dict[tuple[str, str], list[str]] = {}

    def place_of(self, agent: Agent, wish: Queue) -> tuple[Queue, Vector]:
        """The queue, as its first agent wishes for it, and an agent's place in it.

        Who is not part of the line yet is on the way to its end.
        """
        line = self._present(agent.session_id, wish.name)
        first = self._wish(line[0]) if line else wish
        assert first is not None  # `_present` has looked
        if agent.agent_id in line:
            return first, self._behind(line, line.index(agent.agent_id), first)
        end = self._behind(line, len(line), first)
        if self._comes_next(agent, wish.name, end):
            line.append(agent.agent_id)
            self._lines[agent.session_id, wish.name] = line
        return first, end

    def _behind(self, line: list[str], number: int, first: Queue) -> Vector:
        """Place `number`, farther back by as much as the one before it stands behind its own."""
        if number == 0:
            return queue_place(first, 0.0)
        x, y = self._place(self._registry.agents[line[number - 1]])
        ahead_x, ahead_y = queue_place(first, 0.0)
        back = (x - ahead_x) * sin(first.heading) - (y - ahead_y) * cos(first.heading)
        late = back / first.spacing - (number - 1)
        return queue_place(first, number + (late if abs(late) < 1 else 0.0))

    def _comes_next(self, agent: Agent, name: str, end: Vector) -> bool:
        """Whether it is at the end of the line, and of those who are not in it the nearest."""
        away = dist(self._place(agent), end)
        if away >= JOINS:
            return False
        others = self._registry.sessions[agent.session_id].agents.values()
        line = self._lines.get((agent.session_id, name), [])
        coming = (
            other
            for other in self._still([o.agent_id for o in others], name)
            if other != agent.agent_id and other not in line
        )
        return all(away <= dist(self._place(self._registry.agents[o]), end) for o in coming)

    def _present(self, session_id: str, name: str) -> list[str]:
        """The line, without those who have left it."""
        line = self._lines.get((session_id, name), [])
        left = list(self._still(line, name))
        if left:
            self._lines[session_id, name] = left
        else:
            self._lines.pop((session_id, name), None)
        return left

    def _still(self, line: list[str], name: str) -> Iterator[str]:
        for agent_id in line:
            wish = self._wish(agent_id)
            if wish is not None and wish.name == name:
                yield agent_id

    def _wish(self, agent_id: str) -> Queue | None:
        agent = self._registry.agents.get(agent_id)
        doing = None if agent is None else self._doing(agent)
        return doing if isinstance(doing, Queue) else None
