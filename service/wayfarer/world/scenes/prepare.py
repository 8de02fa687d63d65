"""Compiles the rules of the world before agents walk.

On a machine with a second core another process compiles them in the opposite order meanwhile, and
each loads what the other has kept.
"""

import subprocess
import sys
from functools import cache
from typing import Final

from wayfarer.navigation import sampling
from wayfarer.navigation.paths import find
from wayfarer.process.compiled import is_kept
from wayfarer.process.processor import cores
from wayfarer.world.avoidance import avoid
from wayfarer.world.goals import gait_rules
from wayfarer.world.output import legs, twobone
from wayfarer.world.scenes import (
    around,
    asks,
    cells,
    collision_avoidance,
    lanes,
    leads,
    making_way,
    nearest_obstacles,
    passages,
    people,
    routes,
    spots,
)
from wayfarer.world.stepping import mirror, new_frames, noise, playback

PARTS: Final = (
    new_frames, mirror, cells, people, spots, around, nearest_obstacles, routes, lanes,
    collision_avoidance, leads, asks, making_way, passages, sampling, playback, noise, gait_rules,
    find, legs, twobone, avoid,
)  # fmt: skip
"""The rules that take longest are at both ends, so that the two processes rarely meet in one."""


@cache
def prepare() -> None:
    """Compiles the rules, or loads them."""
    other = None
    if cores() > 1 and not all(is_kept(part) for part in PARTS):
        none = subprocess.DEVNULL
        command = [sys.executable, "-m", "wayfarer.world.scenes.prepare"]
        other = subprocess.Popen(command, stdin=none, stdout=none, stderr=none)
    try:
        for part in PARTS:
            part.prepare()
    finally:
        if other is not None:
            other.kill()
            other.wait()


if __name__ == "__main__":
    for last in reversed(PARTS):
        last.prepare()
