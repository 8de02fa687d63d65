"""Ground that is not level: up a slope and down steps, up stairs to a gallery, and back."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from wayfarer.navigation.examples import PLATFORM, slope_with_steps, two_storeys
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import Point2, Point3
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.figures import quantile
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.goals import Watch
from wayfarer_lab.evaluation.scenes.play import House, person
from wayfarer_lab.evaluation.scenes.scenarios.seen import Seen, errands

PACE = 0.4
"""m/s: an agent that is slower than this on average, plus 15 s, has failed."""


def slope(house: House, seed: int, people: int, watch: Watch) -> Seen:
    """Up the slope, over the platform, down the steps, and the same way back."""
    stops = ((10.0, 11.0, PLATFORM), (10.0, 18.0, 0.0), (10.0, 11.0, PLATFORM), (10.0, 1.5, 0.0))
    starts = ((9.0, 11.0), (0.8, 2.2))
    return _climb("slope", house, bake(slope_with_steps()), starts, stops, seed, people, watch)


def storeys(house: House, seed: int, people: int, watch: Watch) -> Seen:
    """Up fifteen stairs to the gallery, and down again."""
    stops = ((10.0, 5.0, 3.0), (1.0, 6.0, 0.0))
    starts = ((0.6, 1.4), (3.5, 7.0))
    return _climb("storeys", house, bake(two_storeys()), starts, stops, seed, people, watch)


def _climb(
    name: str,
    house: House,
    scene: Scene,
    starts: tuple[Point2, Point2],
    stops: Sequence[Point3],
    seed: int,
    people: int,
    watch: Watch,
) -> Seen:
    """Agents one by one, from a place within `starts` (x, y), stop by stop."""
    random = np.random.default_rng(seed)
    places = [(float(random.uniform(*starts[0])), float(random.uniform(*starts[1])))
              for _ in range(people)]  # fmt: skip
    specs = [person(k, random, at, stops[0][:2]) for k, at in enumerate(places)]
    path = [Goal(stop, stop=k == len(stops) - 1) for k, stop in enumerate(stops)]
    ways = [(*places[0], 0.0), *stops]
    metres = sum(scene.path(a, b).length for a, b in pairwise(ways))
    play = house.play(scene, people, avoid=False, every=1)
    seconds = errands(play, specs, [path] * people, 15 + metres / PACE, watch)
    row: Row = {
        "name": name,
        "success": float((~np.isnan(seconds)).mean()),
        "seconds_median": quantile(seconds.tolist(), 0.5),
    }
    return Seen(row | play.figures(), scene, play.witness)
