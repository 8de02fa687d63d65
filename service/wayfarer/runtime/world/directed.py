"""The part of a world that tells agents where to go, and what they meet with on their ways."""

from collections.abc import Sequence

import numpy as np

from wayfarer.navigation.scene import Scene
from wayfarer.runtime.agent import Goal, Wander
from wayfarer.runtime.behaviours import Behaviour, Routine
from wayfarer.runtime.commands import AppendGoals, ClearGoal, Order, SetGoal, SetPath
from wayfarer.runtime.publications import Event
from wayfarer.runtime.scenes.book import Book
from wayfarer.runtime.scenes.populate import Whereabouts
from wayfarer.runtime.stepping.clockwork import Clockwork
from wayfarer.runtime.world.slots import Mode


class Directed(Clockwork):
    """Agents who are given goals, on a flat floor or in a scene; see `World`."""

    # Goals

    def set_goal(self, agent_id: str, goal: Goal, now: float, expected: int | None = None) -> int:
        """Replan for a new goal; return its revision, as for all below.

        Every change of goals raises NotFound, InvalidArgument that names the field, and Aborted
        when the agent's revision is not the `expected` one.
        """
        return self.give(agent_id, SetGoal(goal), now, expected)

    def set_path(
        self, agent_id: str, goals: Sequence[Goal], now: float, expected: int | None = None
    ) -> int:
        """Replan for goals to be visited in turn; one revision for all of them.

        A goal to pass through is done with once it is reached, another one after the agent has
        stood there for its dwell.
        """
        return self.give(agent_id, SetPath(tuple(goals)), now, expected)

    def append_goals(
        self, agent_id: str, goals: Sequence[Goal], now: float, expected: int | None = None
    ) -> int:
        """Add goals to the end of the path, whose goals keep their numbers; nothing is replanned.

        Goals that the agent has passed are forgotten, so a path can be fed for ever. An agent
        without a path begins one; one who wanders goes on with these goals after its present one.
        """
        return self.give(agent_id, AppendGoals(tuple(goals)), now, expected)

    def wander(self, agent_id: str, area: Wander, now: float, expected: int | None = None) -> int:
        """Walk about until another change of goals; one revision for all of it.

        Places are drawn from the agent's seed, its revision and their number in the path.
        """
        return self.give(agent_id, area, now, expected)

    def behave(
        self,
        agent_id: str,
        behaviour: Behaviour | Routine,
        now: float,
        expected: int | None = None,
    ) -> int:
        """Do this until another change of goals; one revision for all of it.

        Besides, raises FailedPrecondition: in a recorded session for what depends on others, and
        on a floor without end for walking all over it.
        """
        return self.give(agent_id, behaviour, now, expected)

    def clear_goal(self, agent_id: str, now: float, expected: int | None = None) -> int:
        """Stop where the agent is. Raises NotFound, Aborted."""
        return self.give(agent_id, ClearGoal(), now, expected)

    def give(self, agent_id: str, order: Order, now: float, expected: int | None = None) -> int:
        """Any change of goals, as it was told to a `Recorder`; see above.

        In a scene, goals off free ground are moved to the nearest that can be reached. Raises
        Unreachable when no way leads to one.
        """
        agent = self._registry.agent(agent_id)
        self._orders.check_revision(agent, expected)
        self._orders.check(agent, order)
        fitted, moves = self._stage.fitted(agent.slot, order)
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
