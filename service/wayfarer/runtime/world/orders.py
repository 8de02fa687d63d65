"""Agents are given goals: replan, write the path, count the revision.

A path is fed for ever: goals that the agent has passed are forgotten when more are added, and the
numbers of the others stay (see paths.py). Wandering is a path that feeds itself.
"""

from collections.abc import Sequence
from typing import assert_never

import numpy as np

from wayfarer.errors import Aborted, InvalidArgument
from wayfarer.runtime.agent import Goal, Wander
from wayfarer.runtime.commands import AppendGoals, ClearGoal, Order, Recorder, SetGoal, SetPath
from wayfarer.runtime.settings import WorldSettings
from wayfarer.runtime.stepping.playback import Playback
from wayfarer.runtime.stepping.timeline import Timeline
from wayfarer.runtime.world.checks import check_area, check_goal, check_path
from wayfarer.runtime.world.handover import AgentRecord
from wayfarer.runtime.world.paths import Paths
from wayfarer.runtime.world.registry import Agent
from wayfarer.runtime.world.slots import Gait, Mode, Motion, Slots
from wayfarer.runtime.world.wandering import wander_goal


class Orders:
    """Changes of the goals of a world's agents."""

    def __init__(
        self,
        slots: Slots,
        playback: Playback,
        timeline: Timeline,
        settings: WorldSettings,
        recorder: Recorder | None,
    ) -> None:
        self._slots = slots
        self._playback = playback
        self._timeline = timeline
        self._settings = settings
        self._recorder = recorder
        # What is planned may be a goal ahead of what is sent for each chunk of it; a wanderer has
        # one more.
        self.paths = Paths(slots, settings.limits.path_goals + settings.lead + 2)

    def check_record(self, record: AgentRecord, where: str) -> None:
        """A path that can be put into this world. Raises InvalidArgument."""
        if len(record.path) > self.paths.limit:
            raise InvalidArgument(
                f"has {len(record.path)} goals; allowed: {self.paths.limit}", f"{where}.path"
            )

    def check_revision(self, agent: Agent, expected: int | None) -> None:
        """Raises Aborted when the agent's revision is another than the expected one."""
        present = int(self._slots.goal_revision[agent.slot])
        if expected is not None and expected != present:
            raise Aborted(
                f"agent {agent.agent_id!r} is at goal revision {present}; this change was meant "
                f"for revision {expected}: look at its goals again"
            )

    def check(self, agent: Agent, order: Order) -> None:
        """Raises InvalidArgument that names the field at fault."""
        limits, slot = self._settings.limits, agent.slot
        x, y, z = (float(v) for v in self._slots.committed.seed.translation[slot, -1])
        match order:
            case SetGoal(goal):
                check_goal(goal, (x, y, z), limits)
            case AppendGoals(goals) if agent.path and agent.wander is None:
                last = agent.path[-1].position
                check_path(goals, last, limits, self._ahead(agent), "the goal before it")
            case SetPath(goals) | AppendGoals(goals):
                check_path(goals, (x, y, z), limits)
            case Wander():
                check_area(order, (x, y), limits)
            case ClearGoal():
                pass
            case _:
                assert_never(order)

    def give(self, agent: Agent, order: Order, now: float) -> int:
        """Carry out an order that has been checked; returns the new revision."""
        if isinstance(order, AppendGoals) and agent.path:
            self._append(agent, order.goals)
        else:
            self._replace(agent, order, now)
        slot = agent.slot
        if self._recorder is not None:
            self._recorder.command(agent.agent_id, order, int(self._slots.planned_chunks[slot]))
        return int(self._slots.goal_revision[slot])

    def walk_on(self, by_slot: dict[int, Agent]) -> None:
        """Give a next place to those wanderers who are on the way to their last one."""
        slots = self._slots
        rows = np.flatnonzero(slots.active & slots.wanders)
        if not len(rows):
            return
        waypoints = slots.planned.gait.waypoint[rows]
        for slot in rows[self.paths.is_last(rows, waypoints)].tolist():
            agent = by_slot[slot]
            self._write(agent, (*self._kept(agent), self._next_place(agent)))

    def restore(self, agent: Agent) -> None:
        """Write the path of an agent who has been put into the world with it, or with none."""
        self._slots.wanders[agent.slot] = agent.wander is not None
        self.paths.put(agent.slot, agent.path, agent.path_start, agent.passed)

    def at_rest(self, agent: Agent) -> Motion:
        """The agent's motion after the last chunk sent, one row, on its present path.

        Goals before are forgotten.
        """
        slots, slot = self._slots, agent.slot
        self._kept(agent)
        motion = slots.committed.take(np.array([slot]))
        if self._is_ahead_of_sent(slot):
            _set_out(motion.gait, 0, walks=bool(agent.path))
        return motion

    def _replace(self, agent: Agent, order: Order, now: float) -> None:
        slots, slot = self._slots, agent.slot
        # What falls due within the margin could not be made again in time.
        keep = self._timeline.frame(now + self._settings.replan_margin)
        self._playback.replan(slot, keep)
        slots.goal_revision[slot] += 1
        slots.revised_chunk[slot] = slots.planned_chunks[slot]
        x, y = slots.planned.seed.translation[slot, -1, :2].tolist()
        agent.path, agent.passed, agent.path_start = (), 0, (x, y)
        agent.wander = order if isinstance(order, Wander) else None
        slots.wanders[slot] = agent.wander is not None
        self._write(agent, self._first_goals(agent, order))
        _set_out(slots.planned.gait, slot, walks=bool(agent.path))

    def _first_goals(self, agent: Agent, order: Order) -> tuple[Goal, ...]:
        match order:
            case SetGoal(goal):
                return (goal,)
            case SetPath(goals) | AppendGoals(goals):
                return goals
            case Wander():
                return (self._next_place(agent),)
            case ClearGoal():
                return ()
            case _:
                assert_never(order)

    def _append(self, agent: Agent, goals: Sequence[Goal]) -> None:
        slots, slot = self._slots, agent.slot
        kept = self._kept(agent)
        if agent.wander is not None:  # what it has drawn beyond its present place was not asked for
            kept = kept[: int(slots.planned.gait.waypoint[slot]) - agent.passed + 1]
        agent.wander, slots.wanders[slot] = None, False
        slots.goal_revision[slot] += 1
        self._write(agent, (*kept, *goals))

    def _kept(self, agent: Agent) -> tuple[Goal, ...]:
        """Forget the goals that even a replan cannot go back to; return the others."""
        slot = agent.slot
        oldest = 0 if self._is_ahead_of_sent(slot) else int(self._sent_waypoint(slot))
        done = oldest - agent.passed
        if done > 0:
            x, y, _ = agent.path[done - 1].position
            agent.path, agent.passed, agent.path_start = agent.path[done:], oldest, (x, y)
        return agent.path

    def _write(self, agent: Agent, goals: tuple[Goal, ...]) -> None:
        agent.path = goals
        self.paths.put(agent.slot, goals, agent.path_start, agent.passed)

    def _next_place(self, agent: Agent) -> Goal:
        assert agent.wander is not None
        start = agent.path[-1].position[:2] if agent.path else agent.path_start
        revision = int(self._slots.goal_revision[agent.slot])
        waypoint = agent.passed + len(agent.path)
        return wander_goal(agent.wander, agent.spec.noise_seed, revision, waypoint, start)

    def _ahead(self, agent: Agent) -> int:
        """Goals of its path that the agent has not reached."""
        gait, slot = self._slots.planned.gait, agent.slot
        reached = int(gait.waypoint[slot]) + int(gait.arrived[slot])
        return agent.passed + len(agent.path) - reached

    def _is_ahead_of_sent(self, slot: int) -> bool:
        """Nothing has been sent yet that was planned for the present path."""
        return bool(self._slots.sent_chunks[slot] <= self._slots.revised_chunk[slot])

    def _sent_waypoint(self, slot: int) -> int:
        return int(self._slots.committed.gait.waypoint[slot])


def _set_out(gait: Gait, row: int, walks: bool) -> None:
    """Let an agent begin its path; without one it goes on as it was, until steering stops it."""
    if walks:
        gait.mode[row] = Mode.WALKING
    gait.arrived[row] = False
    gait.waypoint[row] = 0
