"""Settings of the offline tree search, checked when they are made."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal, Self, get_args

from wayfarer.errors import InvalidArgument
from wayfarer.terms import TERMS
from wayfarer.world.goals.steering import Steering

CLONES: Final = 32
"""Motions per body in the paper's test of control (Sec. 4.2)."""

REACHED: Final = 0.75
"""Metres, horizontal, hips to goal: reached, as in the paper (Sec. 3.3.1)."""

HARD: Final = {"floating": 0.05, "sinking": 0.05, "skating": 0.075}
"""Limits of a hard cost: the thresholds of the contact score (paper Eq. 11)."""

PAPER: Final = {"floating": 1.0, "sinking": 1.0, "skating": 1.0, "goal_distance": 0.1}
"""Contact and distance to the goal, by which the paper ranks (Sec. 4.2), as GAMMA weighs them.

With `HARD` as tolerances the first three are -log of the contact score.
"""

Until = Literal["reached", "standing", "depth"]
"""The end of a tree: within `reach` of the last goal, at a stand there, or at its depth alone."""

MAX_ROWS: Final = 4096
"""Maximum nodes of one agent and level that are tried; more must be a typing error."""


@dataclass(frozen=True, slots=True)
class BeamSettings:
    """N children of every node are tried, the K best of a level kept (paper Sec. 3.3.2).

    Raises InvalidArgument, which names the field.
    """

    children: int = 4  # N
    keep: int = 4  # K
    roots: int | None = None  # children of the first node; None: N × K, as in later levels
    depth: int = 60  # maximum primitives
    until: Until = "reached"
    reach: float = REACHED  # metres, horizontal, hips to the last goal
    memory: float = 0.0  # share of its parent's cost that a node inherits; 0: judged by itself
    weights: Mapping[str, float] | None = None  # of the ranking; None: steering's, by mode
    tolerances: Mapping[str, float] = field(default_factory=dict)  # values of terms without cost
    limits: Mapping[str, float] = field(default_factory=dict)  # a child above one is rejected
    policy: float | None = None  # share of the policy in the latents; None: as in steering
    temperature: float | None = None  # scale of the noise; None: as in steering
    own: float | None = None  # share of the noise that is an agent's own; None: as in steering

    def __post_init__(self) -> None:
        for name, least in (("children", 1), ("keep", 1), ("depth", 0)):
            if getattr(self, name) < least:
                raise InvalidArgument(
                    f"{name} is {getattr(self, name)}; allowed: {least} or more", name
                )
        if self.roots is not None and self.roots < 1:
            raise InvalidArgument(f"roots is {self.roots}; allowed: 1 or more, or None", "roots")
        if max(self.keep * self.children, self.first) > MAX_ROWS:
            raise InvalidArgument(
                f"keep × children is {self.keep * self.children}, roots {self.first}; "
                f"allowed: up to {MAX_ROWS} nodes to try at a level",
                "children",
            )
        if self.children == 1 and self.keep > self.first:
            raise InvalidArgument(
                f"keep is {self.keep}, but with 1 child per node there are never more than the "
                f"{self.first} nodes of the first level",
                "keep",
            )
        if self.until not in get_args(Until):
            raise InvalidArgument(
                f"until is {self.until!r}; allowed: {', '.join(get_args(Until))}", "until"
            )
        if not self.reach > 0:
            raise InvalidArgument(f"reach is {self.reach:g}; allowed: above 0 metres", "reach")
        if not 0 <= self.memory <= 1:
            raise InvalidArgument(f"memory is {self.memory:g}; allowed: 0 to 1", "memory")
        if self.policy is not None and not 0 <= self.policy <= 1:
            raise InvalidArgument(f"policy is {self.policy:g}; allowed: 0 to 1, or None", "policy")
        if self.temperature is not None and not self.temperature >= 0:
            raise InvalidArgument(
                f"temperature is {self.temperature:g}; allowed: 0 or more, or None", "temperature"
            )
        if self.own is not None and not 0 <= self.own <= 1:
            raise InvalidArgument(f"own is {self.own:g}; allowed: 0 to 1, or None", "own")
        _check_terms("weights", self.weights or {})
        _check_terms("tolerances", self.tolerances)
        _check_terms("limits", self.limits)

    @classmethod
    def paper(cls, top: int = 0, **changes: Any) -> Self:
        """The rows of the paper's Table 1: 32 nodes tried per level, latents from the policy.

        `top` 0: "policy (α)", 32 motions of one body side by side, none of which is discarded. k:
        "& top k", of 32 children in all the k best by contact and distance are kept. α is the KL
        weight of the policy's training (Eq. 10): it chooses the model, not the search.
        """
        if top and CLONES % top:
            raise InvalidArgument(
                f"top is {top}; allowed: 0 or a divisor of {CLONES}, such as 1 or 4", "top"
            )
        keep = top or CLONES
        paper = cls(
            children=CLONES // keep,
            keep=keep,
            roots=CLONES,
            weights=PAPER,
            tolerances=HARD,
            policy=1.0,
            temperature=1.0,
            own=0.0,
        )
        return replace(paper, **changes)

    @property
    def first(self) -> int:
        """Children of the first node."""
        return self.keep * self.children if self.roots is None else self.roots

    def steer(self, steering: Steering) -> Steering:
        """The steering with these latents in every mode."""
        asked = {name: getattr(self, name) for name in ("policy", "temperature", "own")}
        given = {name: value for name, value in asked.items() if value is not None}
        searches = {mode: replace(search, **given) for mode, search in steering.searches.items()}
        return replace(steering, searches=searches)


def _check_terms(where: str, table: Mapping[str, float]) -> None:
    for name, value in table.items():
        if name not in TERMS:
            raise InvalidArgument(
                f"{where}: no quality term {name!r}; there are {', '.join(TERMS)}",
                f"{where}.{name}",
            )
        if not value >= 0:
            raise InvalidArgument(
                f"{where}.{name} is {value:g}; allowed: 0 or more", f"{where}.{name}"
            )
