"""Compiled rules of the world, before anybody walks."""

from wayfarer.world.avoidance import avoid
from wayfarer.world.goals import gait_rules
from wayfarer.world.output import footlock, legs, twobone
from wayfarer.world.scenes import around, collision_avoidance, lanes, near, people, routes, spots
from wayfarer.world.stepping import batch, guards, noise, righting


def prepare() -> None:
    """Compile what is compiled, or load it."""
    of_people = avoid, around, near, people, spots, routes, collision_avoidance, lanes
    for rule in (*of_people, legs, twobone, footlock, batch, guards, righting, noise, gait_rules):
        rule.prepare()
