"""Every compiled rule, before anybody walks. `python -m wayfarer.transport.prepare` keeps them."""

from wayfarer.transport.codec import packing
from wayfarer.world.scenes import prepare as rules


def prepare() -> None:
    """Compile what is compiled, or load it."""
    rules.prepare()
    packing.prepare()


if __name__ == "__main__":
    prepare()
