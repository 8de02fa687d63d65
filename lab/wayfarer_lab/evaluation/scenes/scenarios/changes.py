"""Scenes that change while an agent walks: a door shuts and opens again, a crate is dropped.

Each run is compared with one in which nothing changed: the same seeds give the same motion until
the change is felt.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.examples import corridor, corridor_doors, cubes_field
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import Box, Point2
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentSpec, MotionChunk
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.figures import mean, quantile, share
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.scenes.monitor import SceneMonitor
from wayfarer_lab.evaluation.scenes.pairs import random_pairs
from wayfarer_lab.evaluation.scenes.scenarios.outcome import Outcome
from wayfarer_lab.evaluation.scenes.scene_run import SceneRig, SceneRun, arrived, person
from wayfarer_lab.evaluation.tasks import Watch

Array = NDArray[np.floating[Any]]

FELT, SHOWN = 0.001, 0.05
"""Metres by which hips differ from those of a run without the change: at all, and to be seen."""

AHEAD: Final = 2.0
"""Metres before a door at which it shuts, or before an agent at which a crate is dropped."""

SHUT: Final = 6.0
"""Seconds until the door opens again."""

CRATE: Final = 0.8
LIMIT: Final = 45.0
LEAD: Final = 2.5
"""Seconds of walking before a crate comes."""


@dataclass(frozen=True)
class Change:
    """A change at a moment."""

    at: float
    make: Callable[[SceneRun], None]


@dataclass(frozen=True)
class ScenarioWalk:
    """The walk of one agent."""

    start: float  # seconds at which its first frame is shown
    hips: Array  # [T, 3]
    there: bool  # the goal has been reached

    def frame(self, at: float) -> int:
        """The first frame that is shown from a time on."""
        return min(ceil((at - self.start) * FPS - 1e-6), len(self.hips) - 1)


def doors(rig: SceneRig, seed: int, people: int, watch: Watch) -> Outcome:
    """The door of the agent's goal shuts in front of it, and opens after 6 s."""
    random = np.random.default_rng(seed)
    scene, shutters = bake(corridor()), corridor_doors()
    monitor = SceneMonitor(rig.bundle.bodies, scene, 1, strangers=False)
    shuts, opens, success = [], [], []
    for number in range(people):
        name = list(shutters)[int(random.integers(len(shutters)))]
        door = shutters[name]
        x, side = door.center[0], float(np.sign(door.center[1]))
        start = ((x + 12.0) % 24.0, float(random.uniform(-0.7, 0.7)))
        spec = person(number, random, start, (x, 0.0))
        goal = (x + float(random.uniform(-1.5, 1.5)), side * float(random.uniform(3.0, 4.5)))
        plain = _walk(rig, scene, spec, goal, [])
        near = np.linalg.norm(plain.hips[:, :2] - door.center, axis=-1) < AHEAD
        at = plain.start + float(near.argmax()) / FPS
        shut = Change(at, partial(SceneRun.put, name=name, obstacle=door))
        opened = Change(at + SHUT, partial(SceneRun.remove, name=name))
        kept_out = _walk(rig, scene, spec, goal, [shut], limit=opened.at + SHUT)
        run = _walk(rig, scene, spec, goal, [shut, opened], monitor)
        shuts.append(_felt(plain, kept_out, shut.at))
        opens.append(_felt(kept_out, run, opened.at))
        success.append(not kept_out.there and run.there)
        watch(number + 1, people)
    row: Row = {"name": "doors", "success": share(success)}
    row |= _delays("shut", shuts) | _delays("open", opens)
    return Outcome(row | monitor.figures(), scene, monitor)


def crates(rig: SceneRig, seed: int, people: int, watch: Watch) -> Outcome:
    """A crate is dropped 2 m ahead of an agent, on its way."""
    random = np.random.default_rng(seed)
    scene = bake(cubes_field(seed))
    monitor = SceneMonitor(rig.bundle.bodies, scene, 1, strangers=False)
    felt, success = list[tuple[float, float]](), list[bool]()
    pairs = iter(random_pairs(scene, 20 * people, random))
    while len(felt) < people:
        start, goal = next(pairs)
        spec = person(len(felt), random, start, goal)
        plain = _walk(rig, scene, spec, goal, [])
        frame = plain.frame(LEAD)
        if np.linalg.norm(plain.hips[frame, :2] - goal) < 2 * AHEAD:
            continue  # too near to its goal to be stopped on the way
        gone = np.linalg.norm(plain.hips[frame:, :2] - plain.hips[frame, :2], axis=-1)
        spot = plain.hips[frame + int((gone > AHEAD).argmax()), :2]
        crate = Box((float(spot[0]), float(spot[1])), (CRATE, CRATE), 1.0)
        dropped = Change(LEAD, partial(SceneRun.put, name="crate", obstacle=crate))
        run = _walk(rig, scene, spec, goal, [dropped], monitor)
        felt.append(_felt(plain, run, LEAD))
        success.append(run.there)
        watch(len(felt), people)
    row: Row = {"name": "crates", "success": share(success)}
    row |= _delays("crate", felt)
    return Outcome(row | monitor.figures(), scene, monitor)


def _walk(
    rig: SceneRig,
    scene: Scene,
    spec: AgentSpec,
    goal: Point2,
    changes: Sequence[Change],
    monitor: SceneMonitor | None = None,
    limit: float | None = None,
) -> ScenarioWalk:
    """One agent alone in the scene, for `limit` seconds, `LIMIT` without it."""
    play = rig.run(scene, 1, avoid=False, every=1, monitor=monitor)
    [agent] = play.enter([spec])
    play.world.give(agent, Goal((*goal, 0.0)), 0.0)
    chunks, there = list[MotionChunk](), False
    for until, change in [*((c.at, c) for c in changes), (limit or LIMIT, None)]:
        for chunk in play.run(until):
            chunks.append(chunk)
            there = there or arrived(chunk)
        if change:
            change.make(play)
    play.monitor.finish()
    hips = np.concatenate([chunk.translation for chunk in chunks])
    return ScenarioWalk(chunks[0].scheduled_at, hips, there)


def _felt(before: ScenarioWalk, after: ScenarioWalk, at: float) -> tuple[float, float]:
    """Seconds from a change until the motion differs, and until that can be seen; NaN: never."""
    frames = min(len(before.hips), len(after.hips))
    first = before.frame(at)
    apart = np.linalg.norm(before.hips[first:frames] - after.hips[first:frames], axis=-1)

    def after_so_long(metres: float) -> float:
        more = apart > metres
        return (
            before.start + (first + int(more.argmax())) / FPS - at if more.any() else float("nan")
        )

    return after_so_long(FELT), after_so_long(SHOWN)


def _delays(name: str, felt: Sequence[tuple[float, float]]) -> Row:
    taken, seen = zip(*felt, strict=True)
    return {
        f"{name}_felt_s_mean": mean(taken),
        f"{name}_felt_s_max": quantile(taken, 1.0),
        f"{name}_seen_s_mean": mean(seen),
        f"{name}_seen_s_max": quantile(seen, 1.0),
    }
