"""The part of a world that tells agents where to go, and what they meet with on their ways."""

import numpy as np

from wayfarer.navigation.scene import Scene
from wayfarer.runtime.commands import GoalCommand
from wayfarer.runtime.publications import Event
from wayfarer.runtime.scenes.book import Book
from wayfarer.runtime.scenes.populate import Whereabouts
from wayfarer.runtime.stepping.clockwork import Clockwork
from wayfarer.runtime.world.slots import Mode


class Directed(Clockwork):
    """Agents who are given goals, on a flat floor or in a scene; see `World`."""

    # Goals

    def give(
        self, agent_id: str, command: GoalCommand, now: float, expected: int | None = None
    ) -> int:
        """Carry out a goal command, also as a `Recorder` received it; return the new revision.

        In a scene, goals off free ground are moved to the nearest that can be reached. Raises
        NotFound, InvalidArgument that names the field, FailedPrecondition (a behaviour that cannot
        work in this session), Aborted when the agent's revision is not `expected`, and Unreachable
        when no way leads to a goal.
        """
        agent = self._registry.agent(agent_id)
        self._orders.check_revision(agent, expected)
        self._orders.check(agent, command)
        fitted, moves = self._stage.fitted(agent.slot, command)
        revision = self._orders.give(agent, fitted, now)
        self._stage.tell_moves(agent.slot, moves, agent.passed + len(agent.path))
        return revision

    # Scenes

    @property
    def scenes(self) -> Book:
        """Those that sessions may be in."""
        return self._stage.scenery.book

    def take_events(self) -> list[tuple[str, Event]]:
        """What agents have met with on their ways since the last time, by session."""
        agents = self._registry.agents
        events = self._stage.take_events()
        return [(agents[e.agent_id].session_id, e) for e in events if e.agent_id in agents]

    def scene_of_session(self, session_id: str) -> Scene | None:
        """Its scene as the present step sees it; None: it is in none, or has ended."""
        session = self._registry.sessions.get(session_id)
        if session is None or not session.spec.scene:
            return None
        scenery = self._stage.scenery
        return scenery.scene(scenery.number(session.spec.scene))

    def whereabouts(self, session_id: str) -> Whereabouts:
        """Where a session's agents are, and who stands, as of what was sent. Raises NotFound."""
        agents = self._registry.session(session_id).agents
        rows = np.array([agent.slot for agent in agents.values()], np.int64)
        sent = self._table.rows.committed
        stands = sent.gait.mode[rows] == Mode.STANDING
        return Whereabouts(tuple(agents), sent.seed.translation[rows, -1, :2], stands)
