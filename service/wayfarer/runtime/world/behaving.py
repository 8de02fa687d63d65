"""Agents do what they have been told to go on doing: their paths are fed, their goals are moved.

Before every step of theirs. What they do depends on orders, counters and where others are planned
to be, never on the clock.
"""

from typing import Protocol, assert_never

import numpy as np

from wayfarer.navigation.scene import Scene
from wayfarer.navigation.spec import Point3
from wayfarer.runtime.agent import Goal
from wayfarer.runtime.behaviours import (
    Activity,
    Behaviour,
    Follow,
    KeepAway,
    Part,
    Patrol,
    Queue,
    Routine,
    Stand,
    Visit,
    Wander,
)
from wayfarer.runtime.crowd.behaviours import Aim, follow, keep_away, patrolled
from wayfarer.runtime.publications import EventKind
from wayfarer.runtime.scenes.places import free_place
from wayfarer.runtime.world.aims import Aims
from wayfarer.runtime.world.paths import Paths
from wayfarer.runtime.world.queues import Queues
from wayfarer.runtime.world.registry import Agent, Registry
from wayfarer.runtime.world.rows import Index
from wayfarer.runtime.world.slots import Feeding, Slots
from wayfarer.runtime.world.trail import Trails, is_done
from wayfarer.runtime.world.wandering import wander_goal
from wayfarer.spec import STEP_SECONDS

GIVE_UP = 4.0
"""Seconds for which others keep an agent from a place until it goes to the next one instead …"""

NEAR = 1.5
"""… waiting for them, or within so many metres of it."""


class Surroundings(Protocol):
    """What behaviours have to know of scenes, and whom they tell."""

    def scene_of(self, slot: int) -> Scene | None:
        """The scene that a slot is in."""
        ...

    def tell(self, slot: int, kind: EventKind, waypoint: int, detail: str) -> None:
        """Something happened to the agent of a slot."""
        ...


class Behaving:
    """The behaviours of a world's agents."""

    def __init__(
        self,
        slots: Slots,
        paths: Paths,
        trails: Trails,
        registry: Registry,
        around: Surroundings,
        slow_seconds: float,
    ) -> None:
        """`slow_seconds`: of steering; who is slow for so long stands."""
        self._slots = slots
        self._paths = paths
        self._trails = trails
        self._registry = registry
        self._around = around
        self._slow_seconds = slow_seconds
        self._aims = Aims(slots, paths)
        self._queues = Queues(registry, self.doing, self._aims.place)

    def doing(self, agent: Agent) -> Activity | None:
        """What it does now; None: it goes by its path, and no more."""
        behaviour = agent.behaviour
        if not isinstance(behaviour, Routine):
            return behaviour
        return behaviour.parts[agent.part].does if agent.part < len(behaviour.parts) else Stand()

    def begin(self, agent: Agent) -> tuple[Goal, ...]:
        """Its first goals, when its path has been emptied for what it shall do."""
        agent.part, agent.begun = 0, 0
        return self._first_goals(agent)

    def resume(self, agent: Agent) -> None:
        """An agent has been put into the world in the midst of it: a part begins anew."""
        self._enlist(agent)
        doing = self.doing(agent)
        if isinstance(agent.behaviour, Routine) or isinstance(doing, Follow | KeepAway | Queue):
            self._begin_part(agent)

    def leave(self, agent: Agent) -> None:
        """It does nothing any more but go by its path."""
        agent.behaviour = None
        self._slots.feeding[agent.slot] = Feeding.NONE
        self._slots.group[agent.slot] = 0

    def feed(self, due: Index) -> None:
        """Before the step of slots that are due: those who do something are given what to do."""
        slots = self._slots
        rows = due[slots.feeding[due] != Feeding.NONE]
        if not len(rows):
            return
        waypoints = slots.planned.gait.waypoint[rows]
        needs = (slots.feeding[rows] == Feeding.EACH_STEP) | self._paths.is_last(rows, waypoints)
        for slot in rows[needs].tolist():
            self._feed(self._registry.by_slot[slot])
        for slot in self._kept_away(due).tolist():
            self._give_up(self._registry.by_slot[slot])

    # Within

    def _kept_away(self, due: Index) -> Index:
        """Of those who go from place to place: the slots whom others keep from the present one."""
        slots = self._slots
        rows = due[slots.avoids[due] & (slots.feeding[due] == Feeding.AT_END)]
        gait, chunks = slots.planned.gait, slots.planned_chunks[rows]
        way = (
            self._paths.places(rows, gait.waypoint[rows]) - slots.planned.seed.translation[rows, -1]
        )
        near = (np.hypot(way[:, 0], way[:, 1]) < NEAR) & ~gait.arrived[rows]
        since = np.where(slots.near_since[rows] > 0, slots.near_since[rows], np.maximum(chunks, 1))
        slots.near_since[rows] = np.where(near, since, 0)
        lingers = near & ((chunks - since) * STEP_SECONDS > GIVE_UP)
        found: Index = rows[lingers | (slots.memory.waited[rows] > GIVE_UP)]
        return found

    def _give_up(self, agent: Agent) -> None:
        """Let it go to another place."""
        wish, slot = self.doing(agent), agent.slot
        assert isinstance(wish, Wander | Patrol)
        self._slots.memory.waited[slot], self._slots.near_since[slot] = 0, 0
        following = agent.passed + len(self._trails.so_far(agent))
        self._trails.turn_to(agent, (self._next_goal(agent, wish, following),))

    def _feed(self, agent: Agent) -> None:
        if isinstance(agent.behaviour, Routine) and self._is_over(agent, agent.behaviour):
            self._next_part(agent, agent.behaviour)
        match self.doing(agent):
            case Wander() | Patrol() as feeding:
                self._walk_on(agent, feeding)
            case Follow() as wish:
                if (other := self._other(agent, wish.agent_id)) is not None:
                    self._follow(agent, wish, other)
            case KeepAway(place=None) as wish:
                if (other := self._other(agent, wish.agent_id)) is not None:
                    self._flee(agent, wish, self._aims.body(other, agent.slot).place)
            case KeepAway(place=place) as wish:
                assert place is not None  # checked with the order
                self._flee(agent, wish, place)
            case Queue() as wish:
                self._line_up(agent, wish)
            case Stand():
                self._aims.stand(agent)
            case Visit() | None:
                pass
            case never:
                assert_never(never)

    def _walk_on(self, agent: Agent, wish: Wander | Patrol) -> None:
        if self._is_last(agent.slot):
            self._trails.write(agent, (*self._trails.kept(agent), self._next_goal(agent, wish)))

    def _other(self, agent: Agent, other_id: str) -> int | None:
        """Slot of the agent that one minds; when it is there no more, that ends."""
        other = self._registry.sessions[agent.session_id].agents.get(other_id)
        if other is not None:
            return other.slot
        waypoint = int(self._slots.planned.gait.waypoint[agent.slot])
        text = f"agent {other_id!r}, whom this one minded, has been deleted"
        self._around.tell(agent.slot, EventKind.BEHAVIOUR_ENDED, waypoint, text)
        self._slots.group[agent.slot] = 0
        if isinstance(agent.behaviour, Routine):
            self._next_part(agent, agent.behaviour)
        else:
            agent.behaviour = Stand()
            self._aims.stand(agent)
        return None

    def _follow(self, agent: Agent, wish: Follow, other: int) -> None:
        me, leader = self._aims.body(agent.slot, agent.slot), self._aims.body(other, agent.slot)
        group = self._slots.group
        group[other] = group[other] or self._slots.alias[other]
        group[agent.slot] = group[other]
        last = self._aims.standing(agent)
        self._aim(agent, follow(wish, me, leader, last), near=other)

    def _flee(self, agent: Agent, wish: KeepAway, threat: tuple[float, float]) -> None:
        me = self._aims.body(agent.slot, agent.slot)
        flees, scene = self._aims.is_moving(agent), self._around.scene_of(agent.slot)
        if scene is None:
            self._aim(agent, keep_away(wish, me, threat, flees, None))
            return
        height, radius = float(self._slots.footing.hips[agent.slot]), scene.spec.walkable.radius

        def room(points: np.ndarray) -> np.ndarray:
            lifted = np.concatenate([points, np.full((*points.shape[:2], 1), height)], -1)
            return np.asarray(scene.distance(lifted) - radius)

        self._aim(agent, keep_away(wish, me, threat, flees, room))

    def _line_up(self, agent: Agent, wish: Queue) -> None:
        first, place = self._queues.place_of(agent, wish)
        facing = -np.sin(first.heading), np.cos(first.heading)
        self._aim(agent, Aim(place, wish.speed, facing=facing))

    def _aim(self, agent: Agent, aim: Aim, near: int | None = None) -> None:
        """`near`: slot of somebody on whose storey the place is."""
        if aim.place is None:
            self._aims.stand(agent)
            return
        scene = self._around.scene_of(agent.slot)
        place: Point3 = (*aim.place, 0.0)
        if scene is not None:
            height = self._slots.footing.hips[agent.slot if near is None else near]
            place = free_place(scene, (*aim.place, float(height)))
        self._aims.go(agent, aim, place)

    # Parts of a routine

    def _is_over(self, agent: Agent, routine: Routine) -> bool:
        if agent.part >= len(routine.parts):
            return False
        part = routine.parts[agent.part]
        passed = (int(self._slots.planned_chunks[agent.slot]) - agent.begun_seq) * STEP_SECONDS
        if part.seconds and passed >= part.seconds - 1e-6:
            return True
        return (
            isinstance(part.does, Visit)
            and self._is_last(agent.slot)
            and is_done(self._slots, agent.slot, part.does.goals[-1], self._slow_seconds)
        )

    def _next_part(self, agent: Agent, routine: Routine) -> None:
        agent.part += 1
        if routine.repeat:
            agent.part %= len(routine.parts)
        self._begin_part(agent)

    def _begin_part(self, agent: Agent) -> None:
        agent.begun = agent.passed + len(self._trails.so_far(agent))
        goals = self._first_goals(agent)
        walks = isinstance(self.doing(agent), Visit | Wander | Patrol)
        self._trails.turn_to(agent, goals, walks)

    def _first_goals(self, agent: Agent) -> tuple[Goal, ...]:
        self._enlist(agent)
        agent.begun_seq = int(self._slots.planned_chunks[agent.slot])
        match self.doing(agent):
            case Visit(goals):
                return goals
            case Wander() | Patrol() as wish:
                return (self._next_goal(agent, wish, agent.begun),)
            case _:  # is told where to be before the next step
                x, y = self._slots.planned.seed.translation[agent.slot, -1, :2].tolist()
                return (Goal((x, y, self._height(agent.slot))),)

    def _enlist(self, agent: Agent) -> None:
        at_end = isinstance(agent.behaviour, Wander | Patrol)
        self._slots.feeding[agent.slot] = (
            Feeding.NONE
            if agent.behaviour is None
            else (Feeding.AT_END if at_end else Feeding.EACH_STEP)
        )
        self._slots.group[agent.slot] = 0

    # Goals

    def _next_goal(self, agent: Agent, wish: Wander | Patrol, number: int | None = None) -> Goal:
        """What follows its path, as goal `number` of it."""
        number = agent.passed + len(agent.path) if number is None else number
        if isinstance(wish, Patrol):
            return wish.goals[patrolled(number - agent.begun, len(wish.goals), wish.to_and_fro)]
        slot = agent.slot
        start = agent.path[-1].position[:2] if agent.path else agent.path_start
        revision, scene = int(self._slots.goal_revision[slot]), self._around.scene_of(slot)
        height = self._height(slot)
        return wander_goal(wish, agent.spec.noise_seed, revision, number, start, scene, height)

    def _is_last(self, slot: int) -> bool:
        rows = np.array([slot])
        return bool(self._paths.is_last(rows, self._slots.planned.gait.waypoint[rows])[0])

    def _height(self, slot: int) -> float:
        return float(self._slots.footing.hips[slot]) if self._slots.scene[slot] else 0.0


def parts_of(behaviour: Behaviour) -> tuple[Part, ...]:
    """What it consists of."""
    return behaviour.parts if isinstance(behaviour, Routine) else (Part(behaviour),)
