"""The result of a scenario, and people who walk their paths in it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.scene import Scene
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.commands import Path
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.scenes.monitor import SceneMonitor
from wayfarer_lab.evaluation.scenes.scene_run import SceneRun, arrived
from wayfarer_lab.evaluation.tasks import Watch

Array = NDArray[np.floating[Any]]

AFTER: Final = 1.0
"""Seconds for which an agent is measured after its arrival."""


@dataclass(frozen=True)
class Outcome:
    """The row of a scenario, and what to draw of it."""

    row: Row
    scene: Scene
    monitor: SceneMonitor


def walk_paths(
    play: SceneRun,
    people: Sequence[AgentSpec],
    paths: Sequence[Sequence[Goal]],
    limit: float,
    watch: Watch,
) -> Array:
    """Runs people along their paths. Returns the seconds until each has reached its last goal. [n]

    NaN: never reached. People leave a second later: the way counts, not the stand at its end.
    """
    ids = play.enter(people)
    number = {agent: k for k, agent in enumerate(ids)}
    for agent, path in zip(ids, paths, strict=True):
        play.world.give(agent, Path(tuple(path)), play.now)
    seconds = np.full(len(ids), np.nan)
    for chunk in play.run(limit):
        k = number[chunk.agent_id]
        if np.isnan(seconds[k]) and arrived(chunk) and chunk.waypoint == len(paths[k]) - 1:
            seconds[k] = chunk.scheduled_at + STEP_SECONDS
        if chunk.scheduled_at >= seconds[k] + AFTER:
            play.leave(chunk.agent_id)
            if len(number) == len(play.gone):
                break
        watch(chunk.scheduled_at, limit)
    return seconds
