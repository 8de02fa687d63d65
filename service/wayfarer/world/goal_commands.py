"""Carries out goal commands: replans, writes the path, counts the revision.

A path can be extended endlessly: passed goals are forgotten when more are added, and the numbers of
the others stay (goals/agent_paths.py). A behaviour extends its path itself (behaviours/).
"""

from collections.abc import Sequence

from wayfarer.errors import Aborted, FailedPrecondition, InvalidArgument
from wayfarer.world.agents.behaviour import Agent, Behaviour
from wayfarer.world.agents.faults import Faults
from wayfarer.world.agents.goal import Goal, check_goal, check_path
from wayfarer.world.agents.records import AgentRecord
from wayfarer.world.agents.registry import Registry
from wayfarer.world.agents.slots import Feeding, Slots
from wayfarer.world.agents.timeline import Timeline
from wayfarer.world.behaviours.runner import BehaviourRunner, Surroundings, parts_of
from wayfarer.world.goals.agent_paths import AgentPaths, set_out
from wayfarer.world.goals.commands import Append, GoalCommand, Path, Stop
from wayfarer.world.goals.path_columns import PathColumns
from wayfarer.world.stepping.playback import Playback
from wayfarer.world.stepping.settings import WorldSettings


class GoalCommands:
    """Checks and carries out the goal commands of a world's agents."""

    def __init__(
        self,
        *,
        slots: Slots,
        paths: PathColumns,
        playback: Playback,
        timeline: Timeline,
        settings: WorldSettings,
        registry: Registry,
        around: Surroundings,
        faults: Faults,
    ) -> None:
        self._slots = slots
        self._paths = paths
        self._playback = playback
        self._timeline = timeline
        self._settings = settings
        self._registry = registry
        self._around = around
        self._faults = faults
        self._agent_paths = AgentPaths(slots, paths)
        self._behaviours = BehaviourRunner(
            slots=slots,
            paths=paths,
            agent_paths=self._agent_paths,
            registry=registry,
            around=around,
            slow_seconds=settings.steering.slow_seconds,
            faults=faults,
        )

    def check_record(self, record: AgentRecord, where: str) -> None:
        """Checks that a path can be put into this world. Raises InvalidArgument."""
        if len(record.path) > self._paths.limit:
            raise InvalidArgument(
                f"has {len(record.path)} goals; allowed: {self._paths.limit}", f"{where}.path"
            )

    def check(self, agent: Agent, command: GoalCommand, expected: int | None) -> None:
        """Raises Aborted if the agent's revision is not `expected`, and as `World.give`."""
        present = int(self._slots.goal_revision[agent.slot])
        if expected is not None and expected != present:
            raise Aborted(
                f"agent {agent.agent_id!r} is at goal revision {present}; this change was meant "
                f"for revision {expected}: look at its goals again"
            )
        limits, slot = self._settings.limits, agent.slot
        x, y, z = (float(v) for v in self._slots.committed.seed.translation[slot, -1])
        match command:
            case Goal():
                check_goal(command, (x, y, z), limits)
            case Append(goals) if agent.path and agent.behaviour is None:
                last = agent.path[-1].position
                check_path(goals, last, limits, self._ahead(agent), "the goal before it")
            case Path(goals) | Append(goals):
                check_path(goals, (x, y, z), limits)
            case Stop():
                pass
            case behaviour:
                behaviour.check((x, y, z), limits, "behaviour")
                self._check_company(agent, behaviour)

    def give(self, agent: Agent, command: GoalCommand, now: float) -> None:
        """Carries out a command that has been checked."""
        self._faults.pardon(agent.slot)
        # A goal that a behaviour moves need not be reached before others.
        has_goals = agent.path and self._slots.feeding[agent.slot] != Feeding.EACH_STEP
        if isinstance(command, Append) and has_goals:
            self._append(agent, command.goals)
        else:
            self._replace(agent, command, now)
        agent.commanded_seq = int(self._slots.planned_chunks[agent.slot])

    def update_behaviours(self, frame: float) -> None:
        """Updates the behaviours of agents that are due by world frame `frame`."""
        if self._slots.feeding.any():
            self._behaviours.extend_paths(self._playback.due(frame))

    def restore(self, agent: Agent, in_mid_part: bool = False) -> None:
        """Writes the path of an agent that was put into the world, with or without a path."""
        self._paths.put(agent.slot, agent.path, agent.path_start, agent.passed)
        self._behaviours.resume(agent, in_mid_part)

    def _replace(self, agent: Agent, command: GoalCommand, now: float) -> None:
        slots, slot = self._slots, agent.slot
        # Chunks that are due within the margin could not be made again in time.
        keep = self._timeline.frame(now + self._settings.replan_margin)
        self._playback.replan(slot, keep)
        slots.goal_revision[slot] += 1
        slots.revised_chunk[slot] = slots.planned_chunks[slot]
        x, y = slots.planned.seed.translation[slot, -1, :2].tolist()
        agent.path, agent.passed, agent.path_start = (), 0, (x, y)
        self._behaviours.leave(agent)
        self._agent_paths.write(agent, self._first_goals(agent, command))
        walks = bool(agent.path) and self._behaviours.sets_out(agent)
        set_out(slots.planned.gait, slot, 0, walks)

    def _first_goals(self, agent: Agent, command: GoalCommand) -> tuple[Goal, ...]:
        match command:
            case Goal():
                return (command,)
            case Path(goals) | Append(goals):
                return goals
            case Stop():
                return ()
            case behaviour:
                agent.behaviour = behaviour
                return self._behaviours.begin(agent)

    def _append(self, agent: Agent, goals: Sequence[Goal]) -> None:
        behaves = agent.behaviour is not None
        self._behaviours.leave(agent)
        self._slots.goal_revision[agent.slot] += 1
        # Places that its behaviour has drawn beyond the present one do not belong to a client.
        kept = self._agent_paths.so_far(agent) if behaves else self._agent_paths.kept(agent)
        self._agent_paths.write(agent, (*kept, *goals))

    def _ahead(self, agent: Agent) -> int:
        """Number of goals of its path that the agent has not reached."""
        gait, slot = self._slots.planned.gait, agent.slot
        reached = int(gait.waypoint[slot]) + int(gait.arrived[slot])
        return agent.passed + len(agent.path) - reached

    def _check_company(self, agent: Agent, behaviour: Behaviour) -> None:
        """Checks the needs of a behaviour: others, a scene, a session that is not recorded."""
        session = self._registry.sessions[agent.session_id]
        parts = parts_of(behaviour)
        if session.spec.record and any(part.NEEDS_OTHERS for part, _ in parts):
            raise FailedPrecondition(
                "in a recorded session every agent's motion follows from its own orders: "
                "following, keeping away and queueing look at others"
            )
        if self._around.scene_of(agent.slot) is None and any(p.needs_scene for p, _ in parts):
            raise FailedPrecondition(
                "only in a scene can an agent walk about all over it: give wander an area, with "
                "center and radius, or create the session in a scene"
            )
        for part, within in parts:
            other, field = part.named_agent, f"behaviour.{within}agent_id"
            if other == agent.agent_id:
                raise InvalidArgument("is the agent itself", field)
            if other and other not in session.agents:
                raise InvalidArgument(
                    f"there is no agent {other!r} in session {session.session_id!r}", field
                )
        behaviour.check_others(agent, self._behaviours)
