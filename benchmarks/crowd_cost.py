"""The cost of the avoidance rule."""

import time

import numpy as np

from benchmarks.bench import Row, best
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.avoidance.avoid import avoid
from wayfarer.world.avoidance.people import People


def rule_cost(density: float, quick: bool) -> Row:
    """Microseconds per agent and step among 200 people, `density` per square metre.

    All are computed at once, and walk in random directions on an open floor.
    """
    count, random = 200, np.random.default_rng(0)
    side = (count / density) ** 0.5
    people = People.empty(count)
    people.number[:] = np.arange(count)
    people.position[:] = random.uniform(0, side, (count, 2))
    turn = random.uniform(0, 2 * np.pi, count)
    preferred = (1.2 * np.stack([np.cos(turn), np.sin(turn)], -1)).astype(np.float32)
    people.velocity[:] = people.memory.preferred[:] = preferred
    people.walks[:], people.radius[:] = True, 0.22
    left = np.full(count, 10.0, np.float32)
    rows = np.arange(count)
    seconds = best(
        lambda: avoid(people, rows, preferred, None, STEP_SECONDS, left),
        0.3 if quick else 3.0,
        time.thread_time,
    )
    return {"people per m2": density, "us per agent and step": 1e6 * seconds / count}
