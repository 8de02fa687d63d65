"""Manoeuvres in the world that serves: the only file here that steps it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from wayfarer.model_bundle import Bodies, ModelBundle
from wayfarer.navigation.scene import Scene, bake
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.goals.steering import Steering
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.stepping.rules import RULES, ActingRules
from wayfarer_lab.evaluation.goals import Course, Errand, Watch, run_errands
from wayfarer_lab.evaluation.maneuvers.maneuver import Case, Shot
from wayfarer_lab.evaluation.scenes.solids import ground_height, standing
from wayfarer_lab.evaluation.takes import Take
from wayfarer_lab.evaluation.twosided.repair import Repair

Array = NDArray[np.floating[Any]]


ALONE: Final = ActingRules(off=frozenset(RULES) - {"ground"})
"""No rule after the model, but that people in scenes are on the floor: the model knows but one."""


@dataclass(frozen=True)
class Players:
    """An opened motion model, and the candidates of its search."""

    bundle: ModelBundle
    candidates: int
    seed: int

    def play(self, maneuver: str, case: Case, agents: int, raw: bool, watch: Watch) -> list[Shot]:
        """Play a case in a session of its own; the result does not depend on other cases.

        `raw`: the model alone, without any rule after it (`ALONE`).
        """
        errands = self._errands(maneuver, case, agents)
        return self._play(case, errands, ALONE if raw else ActingRules(), watch)

    def play_watched(
        self, maneuver: str, case: Case, agents: int, watch: Watch
    ) -> tuple[list[Shot], Repair]:
        """`play` as sent, and what the rules did."""
        errands = self._errands(maneuver, case, agents)
        specs = [errand.spec for errand in errands]
        repair = Repair(specs, self.bundle.bodies, climbs=case.scene is not None)
        return self._play(case, errands, ActingRules(watch=repair), watch), repair

    def _errands(self, maneuver: str, case: Case, agents: int) -> list[Errand]:
        random = np.random.default_rng([self.seed, crc32(f"{maneuver} {case.name}".encode())])
        return case.errands(agents, random)

    def _play(
        self, case: Case, errands: Sequence[Errand], rules: ActingRules, watch: Watch
    ) -> list[Shot]:
        scene, session, book = None, SessionSpec(avoid=False), None
        if case.scene is not None:
            book = SceneRegistry()
            info = book.add(bake(case.scene()))
            scene = book.scene(info.scene_id)
            session = SessionSpec(scene=info.scene_id, avoid=False)
        steering = Steering().with_search(candidates=self.candidates)
        world = self.bundle.world(len(errands), steering, book, rules)
        courses = run_errands(world, errands, case.seconds, session=session, watch=watch)
        return shots_of(courses, self.bundle.bodies, scene)


def shots_of(courses: Sequence[Course], bodies: Bodies, scene: Scene | None = None) -> list[Shot]:
    """Takes of courses; in a scene, heights of feet are above its ground."""
    found = []
    for number, course in enumerate(courses):
        take = Take.of(course.clip(), bodies[course.spec.gender], f"agent {number}")
        if scene is not None:
            take = replace(take, height=_above_ground(take.soles, scene))
        found.append(Shot(take, course.goal if course.given else None))
    return found


def _above_ground(soles: Array, scene: Scene) -> Array:
    """Of each foot's lowest point, by the ground under each point. [T, 2]"""
    return (soles[..., 2] - ground_height(scene, standing(scene), soles)).min(-1)
