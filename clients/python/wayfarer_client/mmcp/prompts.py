"""Prompts in words: a small grammar, and a refusal that states it.

    walk [slowly | briskly] [forward | backward | left | right] [N m]     "walk briskly left 3 m"
    walk [slowly | briskly] to X, Z                                       "walk to 2, -1.5"
    stand

Clauses are separated by a comma, a full stop or "then". A clause without a distance lasts for the
segment's time.
"""

import math
import re
from dataclasses import dataclass
from typing import Final

GRAMMAR: Final = (
    "walk [slowly | briskly] [forward | backward | left | right] [N m], walk … to X, Z, stand; "
    "several with 'then' between"
)
SPEEDS: Final = {"": 1.2, "slowly": 0.8, "briskly": 1.6}
TURNS: Final = {
    "": 0.0, "forward": 0.0, "left": math.pi / 2, "right": -math.pi / 2, "backward": math.pi
}  # fmt: skip
NUMBER: Final = r"-?\d{1,4}(?:\.\d{1,6})?"
WALK: Final = re.compile(
    rf"walk(?: (?P<speed>slowly|briskly))?"
    rf"(?:(?: (?P<side>forward|backward|left|right))?(?: (?P<far>\d{{1,3}}(?:\.\d{{1,6}})?) ?m)?"
    rf"| to (?P<x>{NUMBER}) ?, ?(?P<z>{NUMBER}))"
)
BREAKS: Final = re.compile(r"\s*(?:[.;]\s|[.;]$|,?\s*\bthen\b|,(?=\s*(?:walk|stand)))\s*")


@dataclass(frozen=True)
class Clause:
    """One clause. `far` and `place` are None if the clause gives neither."""

    speed: float = 0.0  # metres per second; 0: stand
    turn: float = 0.0  # radians to the left, before it walks
    far: float | None = None  # metres
    place: tuple[float, float] | None = None  # x, z


def orders(prompt: str) -> list[Clause]:
    """The clauses of a prompt. Raises ValueError that states the grammar."""
    clauses = [clause for clause in BREAKS.split(" ".join(prompt.lower().split())) if clause]
    if not clauses:
        raise ValueError(f"the prompt is empty; understood are: {GRAMMAR}")
    return [_clause(clause) for clause in clauses]


def _clause(clause: str) -> Clause:
    if clause in ("stand", "stand still"):
        return Clause()
    found = WALK.fullmatch(clause)
    if found is None:
        raise ValueError(f"{clause[:80]!r} is not understood; understood are: {GRAMMAR}")
    speed = SPEEDS[found["speed"] or ""]
    if found["x"] is not None:
        return Clause(speed, place=(float(found["x"]), float(found["z"])))
    far = float(found["far"]) if found["far"] else None
    return Clause(speed, TURNS[found["side"] or ""], far)
