"""Everything about scenes that belongs to one world."""

from collections.abc import Sequence
from dataclasses import replace
from math import dist
from typing import Final, NamedTuple

from wayfarer.errors import Metres, Place, Text
from wayfarer.navigation.scene import Scene
from wayfarer.navigation.scene_spec import Point3
from wayfarer.spec import NEW_FRAMES
from wayfarer.world.agents.faults import Faults
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.slots import Slots
from wayfarer.world.agents.timeline import Timeline
from wayfarer.world.events import Event, EventKind
from wayfarer.world.goals.commands import Append, GoalCommand, Path
from wayfarer.world.goals.path_columns import PathColumns
from wayfarer.world.scenes.guide import SceneGuide
from wayfarer.world.scenes.planner import MOVED, Planner, moved_text
from wayfarer.world.scenes.routes import Routes
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.scenes.world_scenes import WorldScenes
from wayfarer.world.stepping.settings import WorldSettings

MAX_EVENTS: Final = 10_000
"""Maximum number of waiting events; the latest are kept, since nobody may take them."""


class Move(NamedTuple):
    """A goal that was moved to free ground."""

    from_end: int  # its place in the path, 1 for the last one
    metres: float
    place: Point3


class SceneContext:
    """The scenes of a world, the ways through them, and the events of both."""

    def __init__(
        self,
        *,
        registry: SceneRegistry,
        slots: Slots,
        paths: PathColumns,
        timeline: Timeline,
        settings: WorldSettings,
        faults: Faults,
    ) -> None:
        self._faults = faults
        self.scenery = WorldScenes(registry, slots)
        self._slots = slots
        self._timeline = timeline
        self._events: list[Event] = []
        self.routes = routes = Routes(slots)
        planner = Planner(
            slots,
            routes,
            self.scenery,
            paths.move,
            self.tell,
            settings.path_queries_per_step,
            faults,
        )
        self.guide = SceneGuide(slots, routes, self.scenery, planner, self.tell)

    def refresh(self) -> None:
        """Applies changes of scenes; ways are checked again as agents come to step."""
        self._slots.route.doubt[self.scenery.refresh(self._faults.scene)] = True

    def scene_of(self, slot: int) -> Scene | None:
        """The scene that a slot is in, as the present step sees it."""
        number = int(self._slots.scene[slot])
        return self.scenery.scene(number) if number else None

    def fitted(self, slot: int, command: GoalCommand) -> tuple[GoalCommand, list[Move]]:
        """The command with goals that the agent of a slot can reach, and the goals that were moved.

        Goals off free ground are moved to the nearest free place. Raises Unreachable.
        """
        if not self._slots.scene[slot]:
            return command, []
        match command:
            case Goal():
                [fitted], moves = self._reached(slot, [command])
                return fitted, moves
            case Path(goals) | Append(goals):
                found, moves = self._reached(slot, goals)
                return type(command)(found), moves
            case _:
                return command, []

    def tell_moves(self, slot: int, moves: Sequence[Move], waypoints: int) -> None:
        """Reports moves of the last goals of a path, which has `waypoints` goals now."""
        for move in moves:
            waypoint, text = waypoints - move.from_end, moved_text(move.metres, move.place)
            self.tell(slot, EventKind.GOAL_MOVED, waypoint, text)

    def take_events(self) -> list[Event]:
        """The events since the last call."""
        events, self._events = self._events, []
        return events

    def _reached(self, slot: int, goals: Sequence[Goal]) -> tuple[tuple[Goal, ...], list[Move]]:
        slots = self._slots
        number, hips = int(slots.scene[slot]), slots.planned.seed.translation[slot, -1]
        start = float(hips[0]), float(hips[1]), float(slots.footing.hips[slot])
        scene = self.scenery.scene(number)
        found = tuple(replace(goal, position=scene.reach(start, goal.position)) for goal in goals)
        moves = [
            Move(len(goals) - place, metres, goal.position)
            for place, (asked, goal) in enumerate(zip(goals, found, strict=True))
            if (metres := dist(asked.position[:2], goal.position[:2])) > MOVED
        ]
        return found, moves

    def tell(self, slot: int, kind: EventKind, waypoint: int, text: Text) -> None:
        """Reports an event of an agent on the way to a goal of its path."""
        slots = self._slots
        frame = int(slots.start_frame[slot] + NEW_FRAMES * slots.planned_chunks[slot])
        event = Event(
            kind,
            self._timeline.time(frame),
            slots.agent_id[slot],
            int(slots.alias[slot]),
            int(slots.goal_revision[slot]),
            waypoint,
            text.pattern,
            tuple(p if isinstance(p, Metres | Place) else str(p) for p in text.parts),
        )
        self._events.append(event)
        del self._events[:-MAX_EVENTS]
