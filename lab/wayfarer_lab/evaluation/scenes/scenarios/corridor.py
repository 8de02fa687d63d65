"""Two streams of people who meet in a corridor of 2.5 m."""

from typing import Final

import numpy as np

from wayfarer.navigation.examples import corridor as corridor_spec
from wayfarer.navigation.scene import bake
from wayfarer.navigation.scene_spec import Point2
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.figures import quantile
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.goals import Watch
from wayfarer_lab.evaluation.scenes.play import House, person
from wayfarer_lab.evaluation.scenes.scenarios.seen import Seen, errands

LANES: Final = (-0.7, 0.0, 0.7)
FIRST, APART, LENGTH = 0.6, 0.9, 24.0

CLEAR: Final = 90.0
"""Seconds by which all must have come through."""


def corridor(house: House, seed: int, each: int, watch: Watch) -> Seen:
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
    play = house.play(scene, 2 * each, avoid=True, every=2)
    people = [person(k, random, a, b) for k, (a, b) in enumerate(ends)]
    seconds = errands(play, people, [[Goal((*b, 0.0))] for _, b in ends], CLEAR, watch)
    there = ~np.isnan(seconds)
    row: Row = {
        "name": "corridor",
        "success": float(there.mean()),
        "seconds_median": quantile(seconds.tolist(), 0.5),
        "seconds_last": float(seconds.max()) if there.all() else float("nan"),
    }
    return Seen(row | play.figures(), scene, play.witness)
