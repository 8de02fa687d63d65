"""Manoeuvres in the world that serves: the only file here that steps it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from wayfarer.models.bundle import Bodies, ModelBundle
from wayfarer.navigation.scene import Scene
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.goals.steering import Steering
from wayfarer.world.scenes.messages import SceneSource
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.stepping.rules import RULES, ActingRules
from wayfarer_lab.evaluation.maneuvers.maneuver import Case, MeasuredTake
from wayfarer_lab.evaluation.maneuvers.repair import Repair
from wayfarer_lab.evaluation.scenes.solids import ground_height, standing
from wayfarer_lab.evaluation.takes import Take
from wayfarer_lab.evaluation.tasks import AgentTask, Trajectory, Watch, run_tasks

Array = NDArray[np.floating[Any]]


ALONE: Final = ActingRules(off=frozenset(RULES) - {"ground"})
"""No rule after the model, but that people in scenes are on the floor: the model knows but one."""


@dataclass(frozen=True)
class CaseRunner:
    """An opened motion model, and the candidates of its search."""

    bundle: ModelBundle
    candidates: int
    seed: int

    def run(
        self, maneuver: str, case: Case, agents: int, raw: bool, watch: Watch
    ) -> list[MeasuredTake]:
        """Runs a case in its own session; the result does not depend on other cases.

        `raw`: the model alone, without any rule after it (`ALONE`).
        """
        tasks = self._tasks(maneuver, case, agents)
        return self._run(case, tasks, ALONE if raw else ActingRules(), watch)

    def run_watched(
        self, maneuver: str, case: Case, agents: int, watch: Watch
    ) -> tuple[list[MeasuredTake], Repair]:
        """Runs a case as sent; also returns what the rules did."""
        tasks = self._tasks(maneuver, case, agents)
        specs = [task.spec for task in tasks]
        repair = Repair(specs, self.bundle.bodies, climbs=case.scene is not None)
        return self._run(case, tasks, ActingRules(watch=repair), watch), repair

    def _tasks(self, maneuver: str, case: Case, agents: int) -> list[AgentTask]:
        random = np.random.default_rng([self.seed, crc32(f"{maneuver} {case.name}".encode())])
        return case.tasks(agents, random)

    def _run(
        self, case: Case, tasks: Sequence[AgentTask], rules: ActingRules, watch: Watch
    ) -> list[MeasuredTake]:
        scene, session, scenes = None, SessionSpec(avoid=False), None
        if case.scene is not None:
            scenes = SceneRegistry()
            scene_id = scenes.create(SceneSource(case.scene())).scene_id
            scene = scenes.entry(scene_id).scene
            session = SessionSpec(scene=scene_id, avoid=False)
        steering = Steering().with_search(candidates=self.candidates)
        world = self.bundle.world(len(tasks), steering, scenes, rules)
        trajectories = run_tasks(world, tasks, case.seconds, session=session, watch=watch)
        return measured_takes(trajectories, self.bundle.bodies, scene)


def measured_takes(
    trajectories: Sequence[Trajectory], bodies: Bodies, scene: Scene | None = None
) -> list[MeasuredTake]:
    """Takes of trajectories; in a scene, heights of feet are above its ground."""
    found = []
    for number, trajectory in enumerate(trajectories):
        take = Take.of(trajectory.clip(), bodies[trajectory.spec.gender], f"agent {number}")
        if scene is not None:
            take = replace(take, height=_above_ground(take.soles, scene))
        found.append(MeasuredTake(take, trajectory.goal if trajectory.given else None))
    return found


def _above_ground(soles: Array, scene: Scene) -> Array:
    """Height of each foot's lowest point above the ground under it. [T, 2]"""
    return (soles[..., 2] - ground_height(scene, standing(scene), soles)).min(-1)
