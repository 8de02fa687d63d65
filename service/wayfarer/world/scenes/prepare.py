"""Compiled rules of the world, before anybody walks."""

from wayfarer.world.avoidance import avoid
from wayfarer.world.goals import gait_rules
from wayfarer.world.output import footlock, legs, twobone
from wayfarer.world.scenes import around
from wayfarer.world.stepping import guards, noise, righting


def prepare() -> None:
    """Compile what is compiled, or load it."""
    for rule in (avoid, around, legs, twobone, footlock, guards, righting, noise, gait_rules):
        rule.prepare()
