"""The scenes of a world's sessions, as its present step sees them."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from wayfarer.errors import FailedPrecondition, NotFound
from wayfarer.navigation.scene import Scene
from wayfarer.world.agents.agent import AgentSpec, SessionSpec
from wayfarer.world.agents.slots import Slots
from wayfarer.world.rows import Array, Double, Index
from wayfarer.world.scenes.scene_registry import SceneEntry, SceneRegistry

NOWHERE = 0
"""Number of the endless flat floor, for sessions that name no scene."""

Clear = Callable[[Array], Array]
"""Metres to the nearest wall [P] at points [P, 2] on an agent's storey."""


class WorldScenes:
    """Scenes by number; no number comes to stand for another scene."""

    def __init__(self, registry: SceneRegistry, slots: Slots) -> None:
        self.registry = registry
        self._slots = slots
        self._next = itertools.count(NOWHERE + 1)
        self._numbers: dict[str, int] = {}
        self._entries: dict[int, SceneEntry] = {}
        self._scenes: dict[int, Scene] = {}

    def enter(self, spec: SessionSpec, session_id: str) -> int:
        """Notes that a session is opened; returns the number of its scene.

        Raises FailedPrecondition if its scene does not exist.
        """
        if not spec.scene:
            return NOWHERE
        if spec.record:
            raise FailedPrecondition(
                "a session in a scene cannot be recorded: leave out `record`, or `scene`"
            )
        try:
            entry = self.registry.enter(spec.scene, session_id)
        except NotFound:
            raise FailedPrecondition(
                f"scene {spec.scene!r} is not here: scenes belong to one server, so create it "
                "first, and let the session name the id that it gets"
            ) from None
        number = self._numbers.setdefault(spec.scene, next(self._next))
        if self._entries.get(number) is not entry:  # otherwise `refresh` tells all its agents
            self._entries[number], self._scenes[number] = entry, entry.scene
        return number

    def leave(self, spec: SessionSpec, session_id: str) -> None:
        """Notes that a session has ended."""
        if spec.scene:
            self.registry.leave(spec.scene, session_id)

    def scene(self, number: int) -> Scene:
        """The version that the present step sees."""
        return self._scenes[number]

    def walls(self, slot: int) -> tuple[Clear, float]:
        """The metres to the nearest wall on a slot's storey, as a function, and those it keeps."""
        row = np.array([slot])
        return (lambda points: self.distance(row, points[None])[0]), float(self.radius(row)[0])

    def distance(self, rows: Index, points: Array) -> Double:
        """Metres to the nearest wall at points [A, N, 2 | 3] of slots [A]; inf without a scene. A
        point without a height is on the storey of its slot.
        """
        numbers, found = self._slots.scene[rows], np.full(points.shape[:2], np.inf)
        present = set(numbers.tolist())
        for number in present - {NOWHERE}:
            scene = self.scene(number)
            mine = np.flatnonzero(numbers == number) if len(present) > 1 else slice(None)
            places = points[mine]
            if len(scene.fields) > 1 and places.shape[-1] == 2:
                heights = np.broadcast_to(
                    self._slots.footing.hips[rows[mine], None, None], (*places.shape[:2], 1)
                )
                places = np.concatenate([places, heights], -1)
            found[mine] = scene.distance(places)
        return found

    def clearance(self, rows: Index, hips: Array) -> tuple[Double, Double]:
        """Metres from places [A, 2] of slots to the nearest wall [A], and the direction away from
        it [A, 2]; see `ClearanceField.sample`.
        """
        numbers, floors = self._slots.scene[rows], self._slots.footing.hips[rows]
        found, away = np.full(len(rows), np.inf), np.zeros((len(rows), 2))
        for number in set(numbers.tolist()) - {NOWHERE}:
            mine = np.flatnonzero(numbers == number)
            places = np.column_stack([hips[mine], floors[mine]])
            found[mine], away[mine] = self.scene(number).clearance(places)
        return found, away

    def radius(self, rows: Index) -> Double:
        """Metres that slots [A] keep from walls; 0 without a scene."""
        numbers = self._slots.scene[rows]
        found = np.zeros(len(rows))
        for number in set(numbers.tolist()) - {NOWHERE}:
            found[numbers == number] = self.scene(number).spec.walkable.radius
        return found

    def refresh(self, failed: Callable[[int, Exception], None]) -> Index:
        """Applies new versions, and forgets scenes without sessions; returns the slots in scenes
        that have a new version.

        `failed(number, error)`: agents continue in that scene's former version.
        """
        self._forget_unused()
        changed = []
        for number, entry in self._entries.items():
            if (scene := entry.scene) is not self._scenes[number]:
                try:
                    self._take_up(number, scene)
                except Exception as error:
                    failed(number, error)
                else:
                    changed.append(number)
        if not changed:
            return np.empty(0, np.int64)
        return np.flatnonzero(self._slots.active & np.isin(self._slots.scene, changed))

    def _forget_unused(self) -> None:
        unused = {number for number, entry in self._entries.items() if not entry.sessions}
        for number in unused.difference(self._slots.scene[self._slots.active].tolist()):
            del self._scenes[number], self._numbers[self._entries.pop(number).scene_id]

    def _take_up(self, number: int, scene: Scene) -> None:
        self._scenes[number] = scene

    def placed(self, spec: SessionSpec, agents: Sequence[AgentSpec]) -> list[AgentSpec]:
        """New agents on free ground: agents off it stand on the nearest. Thread-safe."""
        if not spec.scene:
            return list(agents)
        scene = self.registry.entry(spec.scene).scene
        found = []
        for agent in agents:
            x, y, z = scene.nearest((*agent.position, agent.floor))
            found.append(replace(agent, position=(x, y), floor=z))
        return found
