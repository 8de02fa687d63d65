"""A session in a scene: its people, its changes, and the monitor of its motion."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import atan2
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.models.bundle import ModelBundle
from wayfarer.navigation.scene import Scene
from wayfarer.navigation.scene_spec import Obstacle, Point2
from wayfarer.spec import BETAS, GENDERS
from wayfarer.world.agents.agent import AgentSpec, ChunkFlag, MotionChunk, SessionSpec
from wayfarer.world.goals.steering import Steering
from wayfarer.world.scenes.messages import SceneSource
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.scenes.cost import WORLD, Cost
from wayfarer_lab.evaluation.scenes.monitor import SceneMonitor
from wayfarer_lab.evaluation.tasks import MAX_BETA

Array = NDArray[np.floating[Any]]


def person(number: int, random: np.random.Generator, at: Point2, towards: Point2) -> AgentSpec:
    """People of alternating gender and random shape who face a point."""
    return AgentSpec(
        gender=GENDERS[number % len(GENDERS)],
        betas=tuple(random.uniform(-MAX_BETA, MAX_BETA, BETAS).tolist()),
        position=at,
        heading=atan2(at[0] - towards[0], towards[1] - at[1]),
        noise_seed=int(random.integers(2**63)),
    )


@dataclass(frozen=True)
class SceneRig:
    """Models, bodies and search settings that sessions share."""

    bundle: ModelBundle
    candidates: int

    def run(
        self,
        scene: Scene,
        agents: int,
        *,
        avoid: bool,
        every: int = 4,
        monitor: SceneMonitor | None = None,
    ) -> "SceneRun":
        """A world with one session in the scene. `avoid`: agents see and avoid each other.

        Every `every`-th frame is measured, unless there is a `monitor` that has seen other runs.
        """
        monitor = monitor or SceneMonitor(self.bundle.bodies, scene, every, strangers=avoid)
        return SceneRun(self, scene, agents, avoid, monitor)


class SceneRun:
    """A session, alone in its world."""

    def __init__(
        self, rig: SceneRig, scene: Scene, agents: int, avoid: bool, monitor: SceneMonitor
    ) -> None:
        self.scene, self.now, self.cost = scene, 0.0, Cost()
        self.monitor = monitor
        monitor.change(scene)
        self._scenes = SceneRegistry()
        self._scene_id = self._scenes.create(SceneSource(scene.spec), baked=scene).scene_id
        bundle = replace(rig.bundle, engine=self.cost.engine(rig.bundle.engine))
        steering = Steering().with_search(candidates=rig.candidates)
        self.world = bundle.world(agents, steering, self._scenes)
        self.cost.watch(self.world)
        spec = SessionSpec(scene=self._scene_id, avoid=avoid)
        self.session_id = self.world.create_session(spec, 0.0).session_id
        self.gone: set[str] = set()

    def enter(self, specs: Sequence[AgentSpec]) -> list[str]:
        """Adds people now; returns their ids."""
        infos = self.world.create_agents(self.session_id, specs, self.now)
        for info, spec in zip(infos, specs, strict=True):
            self.monitor.meet(info.agent_id, spec)
        return [info.agent_id for info in infos]

    def leave(self, agent_id: str) -> None:
        """Removes a person; the frames so far stay measured."""
        self.world.delete_agent(agent_id)
        self.gone.add(agent_id)

    def run(self, until: float) -> Iterator[MotionChunk]:
        """Sends all chunks up to a time."""
        chunks = self.world.advance(until)
        step = self.cost.timed(lambda: next(chunks, None), WORLD)
        while (chunk := step()) is not None:
            self.now = max(self.now, chunk.scheduled_at)
            if chunk.agent_id in self.gone:
                continue  # it left in the same moment
            if chunk.agent_id not in self.monitor:
                self.monitor.meet(chunk.agent_id, self.world.get_agent(chunk.agent_id).spec)
            self.monitor.see(chunk)
            yield chunk
        self.now = until

    def put(self, name: str, obstacle: Obstacle) -> None:
        """Puts or moves an obstacle."""
        self._scenes.put(self._scene_id, name, obstacle)
        self._changed()

    def remove(self, name: str) -> None:
        """Removes an obstacle."""
        self._scenes.remove(self._scene_id, name)
        self._changed()

    def figures(self) -> Row:
        """All measures so far, and their cost."""
        self.monitor.finish()
        return self.monitor.figures() | self.cost.figures(self.now)

    def _changed(self) -> None:
        self.scene = self._scenes.entry(self._scene_id).scene
        self.monitor.change(self.scene)


def arrived(chunk: MotionChunk) -> bool:
    """Whether its goal was reached while it lasted."""
    return ChunkFlag.ARRIVED in chunk.flags


def walked(way: Array, every: int = 3) -> float:
    """Metres of a way [N, 2 | 3] of chunks, without the sway of the hips: by every third place."""
    rough = np.concatenate([way[:-1:every], way[-1:]])[:, :2]
    return float(np.linalg.norm(np.diff(rough, axis=0), axis=-1).sum())
