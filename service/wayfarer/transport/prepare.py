"""Compiles all rules before agents walk. `python -m wayfarer.transport.prepare` caches them."""

from wayfarer.transport.codec import packing
from wayfarer.world.scenes import prepare as rules


def prepare() -> None:
    """Compiles the compiled rules, or loads them."""
    rules.prepare()
    packing.prepare()


if __name__ == "__main__":
    prepare()
