"""The paper's setting: 20 x 20 m, 30 boxes, random starts and goals."""

from typing import Final

import numpy as np

from wayfarer.navigation.examples import cubes_field
from wayfarer.navigation.scene import bake
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.figures import mean, quantile
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.goals import Watch
from wayfarer_lab.evaluation.scenes.optimum import shortest_lengths
from wayfarer_lab.evaluation.scenes.pairs import random_pairs
from wayfarer_lab.evaluation.scenes.play import House, person, walked
from wayfarer_lab.evaluation.scenes.scenarios.seen import Seen, errands

PACE: Final = 0.5
"""m/s: an agent that is slower than this on average, plus 10 s, has failed."""


def cubes(house: House, seed: int, pairs: int, watch: Watch) -> Seen:
    """Every agent is alone in the field; agents do not see each other."""
    random = np.random.default_rng(seed)
    scene = bake(cubes_field(seed))
    asked = random_pairs(scene, pairs, random)
    found = np.array([scene.path(*pair).length for pair in asked])
    optimum = shortest_lengths(scene, asked)
    play = house.play(scene, pairs, avoid=False, every=1)
    people = [person(k, random, a, b) for k, (a, b) in enumerate(asked)]
    paths = [[Goal((*b, 0.0))] for _, b in asked]
    seconds = errands(play, people, paths, float(10 + found.max() / PACE), watch)
    there = seconds <= 10 + found / PACE
    ways = [play.witness.trail(number) for number in range(pairs)]
    # an agent arrives within the goal's radius: what is left of the way is added
    left = [np.linalg.norm(way[-1, :2] - b) for way, (_, b) in zip(ways, asked, strict=True)]
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
    return Seen(row | play.figures(), scene, play.witness)
