"""Rules that change the model's output, by name, and the laboratory's switch for them.

A service leaves all of them on; only code that makes its own `WorldSettings` can switch one off.
Without them the laboratory sees the bare model, and with `watch` how far each rule moves a body.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from wayfarer.errors import InvalidArgument
from wayfarer.world.rows import Float, Index

RULES: Final = ("mirror", "guards", "righting", "foot lock", "getting up", "ground")
"""Rules in the order in which they act. All except *ground* act before the frames are planned, and
the next step starts from their result; *ground* acts on the sent frames.
"""

MODEL: Final = "model"
"""Name for `watch` before the first rule has acted."""

PLANNED: Final = "planned"
"""Name for `watch` before the first rule that acts on sent frames."""

Watch = Callable[[str, Index, Float, Float], None]
"""Called with a rule's name and, after it has acted, the slots [A] and those agents' frames: hips
[A, F, 3] in the world and rotations [A, F, 22, 4]. It is not called for the mirror, which has no
frames, or for agents that get up, and for the ground only in scenes.
"""


@dataclass(frozen=True, slots=True)
class ActingRules:
    """The rules that act, and their watcher."""

    off: frozenset[str] = frozenset()
    watch: Watch | None = None

    def __post_init__(self) -> None:
        if unknown := sorted(self.off - set(RULES)):
            raise InvalidArgument(f"there is no rule {unknown}; there are {RULES}", "rules")

    def acts(self, name: str) -> bool:
        """Whether a rule is on."""
        return name not in self.off

    def tell(self, name: str, slots: Index, translation: Float, rotations: Float) -> None:
        """Reports a rule's result to the watcher."""
        if self.watch is not None:
            self.watch(name, slots, translation.copy(), rotations.copy())

    def in_turn(self, *names: str) -> list[list[str]]:
        """Those of some rules that act; each alone if somebody watches, otherwise together."""
        acting = [name for name in names if self.acts(name)]
        return [acting] if self.watch is None or not acting else [[name] for name in acting]
