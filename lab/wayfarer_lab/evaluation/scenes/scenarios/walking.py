"""People who walk in the example scenes: between boxes, in a corridor, on a square, up and down."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from wayfarer.navigation.examples import (
    PLATFORM,
    cubes_field,
    rectangle,
    slope_with_steps,
    town_square,
    two_storeys,
)
from wayfarer.navigation.examples import corridor as corridor_spec
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import Box, Floor, Point2, Point3, SceneSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.scenes.messages import Crowd
from wayfarer_lab.evaluation.figures import mean, quantile
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.scenes.pairs import random_pairs, shortest_lengths
from wayfarer_lab.evaluation.scenes.scenarios.outcome import Outcome, walk_paths
from wayfarer_lab.evaluation.scenes.scene_run import SceneRig, person, walked
from wayfarer_lab.evaluation.tasks import Watch

PACE: Final = 0.5
"""m/s: an agent that is slower than this on average, plus 10 s, has failed."""


def cubes(rig: SceneRig, seed: int, pairs: int, watch: Watch) -> Outcome:
    """The paper's setting: 20 x 20 m, 30 boxes, random pairs. Agents do not see each other."""
    random = np.random.default_rng(seed)
    scene = bake(cubes_field(seed))
    pairs_walked = random_pairs(scene, pairs, random)
    found = np.array([scene.path(*pair).length for pair in pairs_walked])
    optimum = shortest_lengths(scene, pairs_walked)
    play = rig.run(scene, pairs, avoid=False, every=1)
    people = [person(k, random, a, b) for k, (a, b) in enumerate(pairs_walked)]
    paths = [[Goal((*b, 0.0))] for _, b in pairs_walked]
    seconds = walk_paths(play, people, paths, float(10 + found.max() / PACE), watch)
    there = seconds <= 10 + found / PACE
    ways = [play.monitor.trail(number) for number in range(pairs)]
    # an agent arrives within the goal's radius: what is left of the way is added
    left = [np.linalg.norm(way[-1, :2] - b) for way, (_, b) in zip(ways, pairs_walked, strict=True)]
    gone = np.array([walked(way) for way in ways]) + left
    ratio = found / optimum
    row: Row = {
        "name": "cubes",
        "success": float(there.mean()),
        "path_ratio": float(ratio.mean()),
        "path_ratio_p95": float(np.quantile(ratio, 0.95)),
        "path_ratio_max": float(ratio.max()),
        "walked_ratio": mean((gone / optimum)[there].tolist()),
        "seconds_median": quantile(seconds[there].tolist(), 0.5),
    }
    return Outcome(row | play.figures(), scene, play.monitor)


LANES: Final = (-0.7, 0.0, 0.7)
FIRST, APART, LENGTH = 0.6, 0.9, 24.0

CLEAR: Final = 90.0
"""Seconds by which all must have come through."""


def corridor(rig: SceneRig, seed: int, each: int, watch: Watch) -> Outcome:
    """`each` people at either end walk to the other end; those in front go farthest."""
    random = np.random.default_rng(seed)
    scene = bake(corridor_spec())
    ends: list[tuple[Point2, Point2]] = []
    for number in range(each):
        place, lane = divmod(number, len(LANES))
        back = FIRST + APART * place
        front = FIRST + APART * ((each - 1) // len(LANES) - place)
        ends.append(((back, LANES[lane]), (LENGTH - front, LANES[lane])))
        ends.append(((LENGTH - back, -LANES[lane]), (front, -LANES[lane])))
    return _streams("corridor", rig, scene, ends, random, watch)


ROOM, WALL, DOOR = 5.0, 0.16, 1.2
"""Metres: side of a room, thickness of the wall between two of them, width of its door."""


def doorway(rig: SceneRig, seed: int, each: int, watch: Watch) -> Outcome:
    """`each` people in either of two rooms walk through the door between them to the other."""
    random = np.random.default_rng(seed)
    beside = (ROOM - DOOR) / 2
    wall = [Box((0.0, side * (DOOR + beside) / 2), (WALL, beside), 2.6) for side in (-1.0, 1.0)]
    ground = Floor(rectangle(-ROOM, -ROOM / 2, ROOM, ROOM / 2))
    ends: list[tuple[Point2, Point2]] = []
    for number in range(each):
        row, lane = divmod(number, len(PLACES))
        start, goal = (1.8 + APART * row, PLACES[lane]), (1.8 + APART * row, -PLACES[lane])
        ends.append(((-start[0], start[1]), goal))
        ends.append((start, (-goal[0], goal[1])))
    return _streams("doorway", rig, bake(SceneSpec((ground,), tuple(wall))), ends, random, watch)


PLACES: Final = (-1.5, -0.5, 0.5, 1.5)


def _streams(
    name: str,
    rig: SceneRig,
    scene: Scene,
    ends: Sequence[tuple[Point2, Point2]],
    random: np.random.Generator,
    watch: Watch,
) -> Outcome:
    """People who walk from one end to the other, and see each other."""
    play = rig.run(scene, len(ends), avoid=True, every=2)
    people = [person(k, random, a, b) for k, (a, b) in enumerate(ends)]
    seconds = walk_paths(play, people, [[Goal((*b, 0.0))] for _, b in ends], CLEAR, watch)
    there = ~np.isnan(seconds)
    row: Row = {
        "name": name,
        "success": float(there.mean()),
        "seconds_median": quantile(seconds.tolist(), 0.5),
        "seconds_last": float(seconds.max()) if there.all() else float("nan"),
    }
    return Outcome(row | play.figures(), scene, play.monitor)


EVERY: Final = 8
"""Frames between measured ones: 5 a second."""


def square(seconds: float, rig: SceneRig, seed: int, people: int, watch: Watch) -> Outcome:
    """One call populates it; after that there are no commands."""
    scene = bake(town_square())
    play = rig.run(scene, people, avoid=True, every=EVERY)
    play.world.crowds.set(play.session_id, Crowd(people, seed), 0.0)
    play.world.crowds.tend(0.0)  # an empty world has no moments at which it would do so itself
    for chunk in play.run(seconds):
        watch(chunk.scheduled_at, seconds)
    reached = sum(p.arrivals for p in play.monitor.progress)
    stuck = np.array([p.stuck_at is not None for p in play.monitor.progress])
    row: Row = {
        "name": "square",
        "success": float((~stuck).mean()),
        "goals_per_minute_each": reached / len(stuck) / (seconds / 60),
    }
    return Outcome(row | play.figures(), scene, play.monitor)


CLIMB_PACE = 0.4
"""m/s: an agent that is slower than this on average, plus 15 s, has failed."""


def slope(rig: SceneRig, seed: int, people: int, watch: Watch) -> Outcome:
    """Up the slope, over the platform, down the steps, and the same way back."""
    stops = ((10.0, 11.0, PLATFORM), (10.0, 18.0, 0.0), (10.0, 11.0, PLATFORM), (10.0, 1.5, 0.0))
    starts = ((9.0, 11.0), (0.8, 2.2))
    return _climb("slope", rig, bake(slope_with_steps()), starts, stops, seed, people, watch)


def storeys(rig: SceneRig, seed: int, people: int, watch: Watch) -> Outcome:
    """Up fifteen stairs to the gallery, and down again."""
    stops = ((10.0, 5.0, 3.0), (1.0, 6.0, 0.0))
    starts = ((0.6, 1.4), (3.5, 7.0))
    return _climb("storeys", rig, bake(two_storeys()), starts, stops, seed, people, watch)


def _climb(
    name: str,
    rig: SceneRig,
    scene: Scene,
    starts: tuple[Point2, Point2],
    stops: Sequence[Point3],
    seed: int,
    people: int,
    watch: Watch,
) -> Outcome:
    """Agents one by one, from a place within `starts` (x, y), stop by stop."""
    random = np.random.default_rng(seed)
    places = [(float(random.uniform(*starts[0])), float(random.uniform(*starts[1])))
              for _ in range(people)]  # fmt: skip
    specs = [person(k, random, at, stops[0][:2]) for k, at in enumerate(places)]
    path = [Goal(stop, stop=k == len(stops) - 1) for k, stop in enumerate(stops)]
    ways = [(*places[0], 0.0), *stops]
    metres = sum(scene.path(a, b).length for a, b in pairwise(ways))
    play = rig.run(scene, people, avoid=False, every=1)
    seconds = walk_paths(play, specs, [path] * people, 15 + metres / CLIMB_PACE, watch)
    row: Row = {
        "name": name,
        "success": float((~np.isnan(seconds)).mean()),
        "seconds_median": quantile(seconds.tolist(), 0.5),
    }
    return Outcome(row | play.figures(), scene, play.monitor)
