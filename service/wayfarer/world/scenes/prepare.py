"""Compiled rules, before anybody walks. `python -m wayfarer.world.scenes.prepare` keeps them."""

from wayfarer.world.avoidance import avoid
from wayfarer.world.scenes import around


def prepare() -> None:
    """Compile what is compiled, or load it."""
    avoid.prepare()
    around.prepare()


if __name__ == "__main__":
    prepare()
