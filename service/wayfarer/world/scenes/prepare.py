"""Compiled rules, before anybody walks. `python -m wayfarer.world.scenes.prepare` keeps them."""

from wayfarer.world.avoidance import avoid
from wayfarer.world.output import footlock, legs, twobone
from wayfarer.world.scenes import around
from wayfarer.world.stepping import guards, righting


def prepare() -> None:
    """Compile what is compiled, or load it."""
    for rule in (avoid, around, legs, twobone, footlock, guards, righting):
        rule.prepare()


if __name__ == "__main__":
    prepare()
