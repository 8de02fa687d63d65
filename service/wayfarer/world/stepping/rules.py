"""Rules that change what the model has made, by name, and the laboratory's switch for them.

A service leaves all of them on: nothing but code that makes its own `WorldSettings` can take one
away. Without them the laboratory sees what the model does alone, and beside it how far each rule
moves a body.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from wayfarer.errors import InvalidArgument
from wayfarer.world.rows import Float, Index

RULES: Final = ("mirror", "guards", "righting", "foot lock", "getting up", "ground")
"""In the order in which they act: all but *ground* before the frames are planned, and from where
they end the next step starts; the ground on what is sent."""

MODEL: Final = "model"
"""What `watch` is told before the first of them has acted."""

PLANNED: Final = "planned"
"""… and before the first that acts on what is sent."""

Watch = Callable[[str, Index, Float, Float], None]
"""Called with a rule's name and, after it has acted, the slots [A] and the frames of those agents:
hips [A, F, 3] in the world and rotations [A, F, 22, 4]. The mirror has no frames of its own, who
gets up is not told, and the ground is told in scenes alone."""


@dataclass(frozen=True, slots=True)
class ActingRules:
    """Which rules act, and who is told of it."""

    off: frozenset[str] = frozenset()
    watch: Watch | None = None

    def __post_init__(self) -> None:
        if unknown := sorted(self.off - set(RULES)):
            raise InvalidArgument(f"there is no rule {unknown}; there are {RULES}", "rules")

    def acts(self, name: str) -> bool:
        """Whether a rule is on."""
        return name not in self.off

    def tell(self, name: str, slots: Index, translation: Float, rotations: Float) -> None:
        """Tell who watches what a rule has made."""
        if self.watch is not None:
            self.watch(name, slots, translation, rotations)
