"""Compiles the rules of the world before agents walk."""

from wayfarer.navigation import sampling
from wayfarer.navigation.paths import find
from wayfarer.world.avoidance import avoid
from wayfarer.world.goals import gait_rules
from wayfarer.world.output import legs, twobone
from wayfarer.world.scenes import around, collision_avoidance, lanes, near, people, routes, spots
from wayfarer.world.stepping import mirror, new_frames, noise, playback


def prepare() -> None:
    """Compiles the rules, or loads them."""
    of_people = avoid, around, near, people, spots, routes, collision_avoidance, lanes
    of_bodies = legs, twobone, mirror, new_frames
    for rule in (*of_people, *of_bodies, sampling, find, noise, playback, gait_rules):
        rule.prepare()
