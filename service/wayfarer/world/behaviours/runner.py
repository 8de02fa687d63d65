"""Runs behaviours: before each step of an agent, extends its path or moves its goal.

An agent's behaviour depends on its commands, on counters and on the planned places of other agents,
never on the clock.
"""

from collections.abc import Callable
from typing import Final, Protocol, TypeVar, cast

import numpy as np

from wayfarer.errors import Text
from wayfarer.navigation.scene import Scene
from wayfarer.navigation.scene_spec import Point3
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.behaviour import Agent, Aim, Behaviour, BodyState, Others, Vector
from wayfarer.world.agents.faults import Faults, Stage
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.registry import Registry
from wayfarer.world.agents.slots import Feeding, Slots
from wayfarer.world.behaviours.moving_goals import MovingGoals
from wayfarer.world.behaviours.places import free_place
from wayfarer.world.behaviours.routine import Part, Routine, Stand
from wayfarer.world.events import EventKind
from wayfarer.world.goals.agent_paths import AgentPaths, is_done
from wayfarer.world.goals.path_columns import PathColumns
from wayfarer.world.rows import Index

T = TypeVar("T")

GIVE_UP: Final = 4.0
"""Seconds for which others keep an agent from a place until it chooses the next one."""

NEAR: Final = 1.5
"""Metres from a place within which an agent counts as kept from it."""


class Surroundings(Protocol):
    """The knowledge of scenes that behaviours need, and the receiver of their events."""

    def scene_of(self, slot: int) -> Scene | None:
        """The scene that a slot is in."""
        ...

    def tell(self, slot: int, kind: EventKind, waypoint: int, text: Text) -> None:
        """Reports an event of a slot's agent."""
        ...


class BehaviourRunner:
    """The behaviours of a world's agents."""

    def __init__(
        self,
        *,
        slots: Slots,
        paths: PathColumns,
        agent_paths: AgentPaths,
        registry: Registry,
        around: Surroundings,
        slow_seconds: float,
        faults: Faults,
    ) -> None:
        """`slow_seconds`: as in steering; an agent that has been slow for this long stands."""
        self.slots = slots
        self.agent_paths = agent_paths
        self.registry = registry
        self.around = around
        self.slow_seconds = slow_seconds
        self._faults = faults
        self.goals = MovingGoals(slots, paths)
        self._paths = paths
        self._kind_state: dict[object, object] = {}  # state of kinds

    def doing(self, agent: Agent) -> Behaviour | None:
        """Its present behaviour; None: it only follows its path."""
        behaviour = agent.behaviour
        if not isinstance(behaviour, Routine):
            return behaviour
        return behaviour.parts[agent.part].does if agent.part < len(behaviour.parts) else Stand()

    def begin(self, agent: Agent) -> tuple[Goal, ...]:
        """The first goals of an agent's new behaviour; its path is empty."""
        agent.part, agent.begun = 0, 0
        return self._first_goals(agent)

    def sets_out(self, agent: Agent) -> bool:
        """Whether its first goal is a fixed place, rather than one that its behaviour must move."""
        doing = self.doing(agent)
        return doing is None or doing.WALKS

    def resume(self, agent: Agent, in_mid_part: bool) -> None:
        """Resumes the behaviour of an agent that has been put into the world.

        A behaviour that depends on others starts again, and so does a part of a routine, unless the
        agent is known to be `in_mid_part`.
        """
        self._enlist(agent)
        doing = self.doing(agent)
        again = isinstance(agent.behaviour, Routine) and not in_mid_part
        if again or (doing is not None and doing.NEEDS_OTHERS):
            self._begin_part(agent)

    def leave(self, agent: Agent) -> None:
        """Ends its behaviour, so that it only follows its path."""
        agent.behaviour = None
        self.slots.feeding[agent.slot] = Feeding.NONE
        self.slots.group[agent.slot] = 0

    def extend_paths(self, due: Index) -> None:
        """Updates the behaviours of agents in due slots, before their step."""
        if self._faults.any:
            due = due[~self._faults.out(due, Stage.BEHAVIOUR)]
        self._faults.stage = Stage.BEHAVIOUR
        try:
            self._feed(due)
        except Exception as error:
            self._faults.split(due, lambda some: self._feed(due[some]), error)

    def _feed(self, due: Index) -> None:
        slots = self.slots
        rows = due[slots.feeding[due] != Feeding.NONE]
        if not len(rows):
            return
        waypoints = slots.planned.gait.waypoint[rows]
        needs = (slots.feeding[rows] == Feeding.EACH_STEP) | self._paths.is_last(rows, waypoints)
        for slot in rows[needs].tolist():
            self._update(self.registry.by_slot[slot])
        for slot in self._kept_away(due).tolist():
            self._give_up(self.registry.by_slot[slot])

    def end(self, agent: Agent, detail: str) -> None:
        """Ends its present activity because an agent that it depends on is gone."""
        waypoint = int(self.slots.planned.gait.waypoint[agent.slot])
        self.around.tell(agent.slot, EventKind.BEHAVIOUR_ENDED, waypoint, Text(detail))
        self.slots.group[agent.slot] = 0
        if isinstance(agent.behaviour, Routine):
            self._next_part(agent, agent.behaviour)
        else:
            agent.behaviour = Stand()
            self.goals.stand(agent)

    def is_last(self, slot: int) -> bool:
        """Whether a slot is on the way to the last goal of its path."""
        rows = np.array([slot])
        return bool(self._paths.is_last(rows, self.slots.planned.gait.waypoint[rows])[0])

    def shared(self, make: Callable[[Others], T]) -> T:
        """Implements `BehavingAgent`."""
        if make not in self._kind_state:
            self._kind_state[make] = make(self)
        return cast(T, self._kind_state[make])

    # As `Others`

    def agent(self, agent_id: str) -> Agent | None:
        """Implements `Others`."""
        return self.registry.agents.get(agent_id)

    def of_session(self, session_id: str) -> list[str]:
        """Implements `Others`."""
        return list(self.registry.sessions[session_id].agents)

    def place(self, agent: Agent) -> Vector:
        """Implements `Others`."""
        return self.goals.place(agent)

    # Private

    def _update(self, agent: Agent) -> None:
        routine = agent.behaviour
        if isinstance(routine, Routine) and self._is_over(agent, routine):
            self._next_part(agent, routine)
        if (doing := self.doing(agent)) is not None:
            doing.update(_Actor(self, agent))

    def _kept_away(self, due: Index) -> Index:
        """Slots whose agents go from place to place and are kept from the present one by others."""
        slots = self.slots
        rows = due[slots.avoids[due] & (slots.feeding[due] == Feeding.AT_END)]
        gait, chunks = slots.planned.gait, slots.planned_chunks[rows]
        way = (
            self._paths.places(rows, gait.waypoint[rows]) - slots.planned.seed.translation[rows, -1]
        )
        near = (np.hypot(way[:, 0], way[:, 1]) < NEAR) & ~gait.arrived[rows]
        since = np.where(slots.near_since[rows] > 0, slots.near_since[rows], np.maximum(chunks, 1))
        slots.near_since[rows] = np.where(near, since, 0)
        lingers = near & ((chunks - since) * STEP_SECONDS > GIVE_UP)
        found: Index = rows[lingers | (slots.planned.aims.stuck[rows] > GIVE_UP)]
        return found

    def _give_up(self, agent: Agent) -> None:
        """Sends it to another place."""
        doing, slot = self.doing(agent), agent.slot
        assert doing is not None  # its slot is fed
        self.slots.planned.aims.stuck[slot], self.slots.near_since[slot] = 0, 0
        number = agent.passed + len(self.agent_paths.so_far(agent))
        self.agent_paths.replace_goals(agent, (doing.next_goal(_Actor(self, agent), number),))

    def _is_over(self, agent: Agent, routine: Routine) -> bool:
        if agent.part >= len(routine.parts):
            return False
        part: Part = routine.parts[agent.part]
        passed = (int(self.slots.planned_chunks[agent.slot]) - agent.begun_seq) * STEP_SECONDS
        if part.seconds and passed >= part.seconds - 1e-6:
            return True
        return part.does.is_over(_Actor(self, agent))

    def _next_part(self, agent: Agent, routine: Routine) -> None:
        agent.part += 1
        if routine.repeat:
            agent.part %= len(routine.parts)
        self._begin_part(agent)

    def _begin_part(self, agent: Agent) -> None:
        agent.begun = agent.passed + len(self.agent_paths.so_far(agent))
        self.agent_paths.replace_goals(agent, self._first_goals(agent), self.sets_out(agent))

    def _first_goals(self, agent: Agent) -> tuple[Goal, ...]:
        self._enlist(agent)
        agent.begun_seq = int(self.slots.planned_chunks[agent.slot])
        doing = self.doing(agent)
        assert doing is not None  # it has been given a behaviour
        return doing.first_goals(_Actor(self, agent), agent.begun)

    def _enlist(self, agent: Agent) -> None:
        behaviour = agent.behaviour
        feeding = Feeding.EACH_STEP
        if behaviour is None:
            feeding = Feeding.NONE
        elif behaviour.FROM_PLACE_TO_PLACE:
            feeding = Feeding.AT_END
        self.slots.feeding[agent.slot] = feeding
        self.slots.group[agent.slot] = 0


class _Actor:
    """Implements `BehavingAgent`, for one agent and one call."""

    def __init__(self, runner: BehaviourRunner, agent: Agent) -> None:
        self._runner = runner
        self._slots = runner.slots
        self.agent = agent
        self.others: Others = runner

    @property
    def scene(self) -> Scene | None:
        """Implements `BehavingAgent`, as do the methods below."""
        return self._runner.around.scene_of(self.agent.slot)

    @property
    def height(self) -> float:
        """Implements `BehavingAgent`."""
        slot = self.agent.slot
        return float(self._slots.footing.hips[slot]) if self._slots.scene[slot] else 0.0

    @property
    def revision(self) -> int:
        """Implements `BehavingAgent`."""
        return int(self._slots.goal_revision[self.agent.slot])

    @property
    def body(self) -> BodyState:
        """Implements `BehavingAgent`."""
        return self._runner.goals.body(self.agent.slot, self.agent.slot)

    @property
    def is_moving(self) -> bool:
        """Implements `BehavingAgent`."""
        return self._runner.goals.is_moving(self.agent)

    @property
    def stood_at(self) -> Vector | None:
        """Implements `BehavingAgent`."""
        return self._runner.goals.standing(self.agent)

    @property
    def is_at_last_goal(self) -> bool:
        """Implements `BehavingAgent`."""
        return self._runner.is_last(self.agent.slot)

    def has_done(self, goal: Goal) -> bool:
        """Implements `BehavingAgent`."""
        return is_done(self._slots, self.agent.slot, goal, self._runner.slow_seconds)

    def here(self) -> Goal:
        """Implements `BehavingAgent`."""
        x, y = self._runner.goals.place(self.agent)
        return Goal((x, y, self.height))

    def look_at(self, agent_id: str) -> BodyState | None:
        """Implements `BehavingAgent`."""
        other = self._runner.registry.sessions[self.agent.session_id].agents.get(agent_id)
        if other is not None:
            return self._runner.goals.body(other.slot, self.agent.slot)
        self._runner.end(self.agent, f"agent {agent_id!r}, whom this one minded, has been deleted")
        return None

    def walk_with(self, agent_id: str) -> None:
        """Implements `BehavingAgent`."""
        group, other = self._slots.group, self._runner.registry.agents[agent_id].slot
        group[other] = group[other] or self._slots.alias[other]
        group[self.agent.slot] = group[other]

    def extend(self, goal: Goal) -> None:
        """Implements `BehavingAgent`."""
        agent_paths = self._runner.agent_paths
        agent_paths.write(self.agent, (*agent_paths.kept(self.agent), goal))

    def aim(self, aim: Aim, on_floor_of: str | None = None) -> None:
        """Implements `BehavingAgent`."""
        runner, agent = self._runner, self.agent
        if aim.place is None:
            runner.goals.stand(agent)
            return
        scene = self.scene
        place: Point3 = (*aim.place, 0.0)
        if scene is not None:
            slot = runner.registry.agents[on_floor_of].slot if on_floor_of else agent.slot
            place = free_place(scene, (*aim.place, float(self._slots.footing.hips[slot])))
        runner.goals.go(agent, aim, place)

    def shared(self, make: Callable[[Others], T]) -> T:
        """Implements `BehavingAgent`."""
        return self._runner.shared(make)


def parts_of(behaviour: Behaviour) -> tuple[tuple[Behaviour, str], ...]:
    """The behaviours of which it consists, each with the field that holds it."""
    if isinstance(behaviour, Routine):
        return tuple((part.does, f"parts[{n}].") for n, part in enumerate(behaviour.parts))
    return ((behaviour, ""),)
