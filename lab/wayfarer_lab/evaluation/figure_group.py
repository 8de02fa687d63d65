"""What a group of definitions is."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Group:
    """Figures that belong together, and what holds for all of them."""

    title: str
    about: str
    figures: Mapping[str, str]  # name, or pattern with * → definition
