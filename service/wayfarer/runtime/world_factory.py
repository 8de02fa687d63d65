"""The worlds of a server: one in real time, one for each session in lock-step, and small ones for
clips and replays. All have the same models, bodies and ways to walk.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.engines.models import LoadedModels
from wayfarer.navigation.examples import is_example
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import SceneSpec
from wayfarer.runtime.persistence.capture import JournalObserver
from wayfarer.runtime.persistence.journal import Journal
from wayfarer.runtime.persistence.record import Recordings
from wayfarer.runtime.persistence.snapshot import BodyStamp
from wayfarer.world.agents.faults import Report
from wayfarer.world.scenes.bake_queue import BakeQueue
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.stepping.settings import ANY_SIZE, WorldSettings
from wayfarer.world.world import World

SLACK: Final = 100.0
"""Metres added in a replay, where an agent receives a goal after all its planned motion rather than
after the motion that is sent.
"""


@dataclass(frozen=True)
class WorldFactory:
    """The parts of which worlds are made."""

    models: LoadedModels
    body: BodyStamp  # identifies the bodies
    bodies: Mapping[str, BodyModel]
    start_poses: NDArray[np.float32]  # [P, 22, 4]
    settings: WorldSettings  # of the world in real time
    journal: Journal | None = None
    bake_queue: BakeQueue | None = None  # None: the caller's thread bakes
    report: Report | None = None  # receives the faults of sessions; None: they are raised

    @cached_property
    def scenes(self) -> SceneRegistry:
        """The scenes that their sessions may be in."""
        return SceneRegistry(
            self.settings.limits, self.settings.new_group, self._bake, self.journal
        )

    @cached_property
    def recordings(self) -> Recordings:
        """The logs of recorded sessions, of the world in real time and of those in lock-step."""
        return Recordings(self.settings.limits.log_entries)

    def _bake(self, spec: SceneSpec) -> Scene:
        """Bakes in the queue's process, which takes seconds to start. An example's cost is known,
        so it is baked on the calling thread at once: the first viewer does not wait.
        """
        if self.bake_queue is None or is_example(spec):
            return bake(spec)
        return self.bake_queue.bake(spec)

    def stop(self) -> None:
        """Bakes no scene from now on."""
        if self.bake_queue:
            self.bake_queue.stop()

    def live(self) -> World:
        """A world in real time."""
        return self._kept(self.settings)

    def lock_step(self) -> World:
        """A world for one session; nothing is degraded, and no agent refused for lack of time."""
        return self._kept(
            replace(self._patient(), limits=self.settings.limits.model_copy(update={"sessions": 1}))
        )

    def apart(self) -> World:
        """A separate world for the trial of one session; nothing of it is kept."""
        settings = self._patient()
        return World(
            self.models.copy(), self.bodies, self.start_poses, settings, self.scenes, self.report
        )

    def solo(self) -> World:
        """A world for a replayed agent or a clip; nothing of it is kept."""
        farther = self.settings.limits.goal_distance_m + SLACK
        one = {"agents": 1, "agents_per_session": 1, "sessions": 1, "goal_distance_m": farther}
        limits = self.settings.limits.model_copy(update=one)
        settings = replace(self._patient(), limits=limits, batch_sizes=(1,))
        return World(self.models.copy(), self.bodies, self.start_poses, settings)

    def _patient(self) -> WorldSettings:
        return replace(
            self.settings,
            budget=None,
            batch_lookahead_s=0.0,
            batch_multiple=1,
            phases=1,
            lead=1,
            batch_sizes=ANY_SIZE,
            single_threaded=True,
            path_queries_per_step=ANY_SIZE[-1],
        )

    def _kept(self, settings: WorldSettings) -> World:
        world = World(
            self.models, self.bodies, self.start_poses, settings, self.scenes, self.report
        )
        world.observe(self.recordings)
        if self.journal is not None:
            world.observe(JournalObserver(self.journal, world))
        return world
