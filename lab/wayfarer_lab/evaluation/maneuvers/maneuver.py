"""A manoeuvre: cases to play, figures of each take, and bars."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import cos, nan, pi, radians, sin
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.scene_spec import SceneSpec
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentInfo
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.figures import mean, quantile
from wayfarer_lab.evaluation.goals import Errand, Plan, relative
from wayfarer_lab.evaluation.takes import Take

Array = NDArray[np.floating[Any]]
Figures = dict[str, float]
"""Name → value; NaN: could not be measured."""

SENT: Final = "sent"
RAW: Final = "raw"
RECORDED: Final = "recorded"
"""Sources of a row: as sent, the model alone without any rule after it, recorded people."""


@dataclass(frozen=True)
class Shot:
    """A take and its goal; a recorded take has none."""

    take: Take
    goal: Goal | None = None  # the last one


@dataclass(frozen=True)
class Case:
    """One variant of a manoeuvre. Every agent gets these orders after 2 s of standing."""

    name: str
    seconds: float  # from the first order
    errands: Callable[[int, np.random.Generator], list[Errand]]  # of N agents
    scene: Callable[[], SceneSpec] | None = None  # None: an endless flat floor
    share: float = 1.0  # of the manoeuvre's agents


@dataclass(frozen=True)
class Bar:
    """The range that a figure has to be in. `case` None: in every case."""

    figure: str
    low: float = -np.inf
    high: float = np.inf
    case: str | None = None
    origin: str = "quality target"

    def met(self, value: float) -> bool | None:
        """Whether `value` is in range; None for NaN."""
        return None if np.isnan(value) else bool(self.low <= value <= self.high)

    def text(self) -> str:
        """The range as text."""
        if np.isinf(self.low):
            return f"≤ {self.high:g}"
        return f"≥ {self.low:g}" if np.isinf(self.high) else f"{self.low:g} … {self.high:g}"


Rows = Mapping[tuple[str, str], Figures]
"""(case, source) → its row."""


Shots = Mapping[tuple[str, str], Sequence[Shot]]
"""(case, source) → its takes."""


def nothing_more(rows: Rows, shots: Shots) -> dict[tuple[str, str], Figures]:
    """The default of `Maneuver.across`: no further rows."""
    return {}


@dataclass(frozen=True)
class Maneuver:
    """What is played, and how it is measured."""

    name: str
    about: str  # a line
    agents: int  # of each case
    cases: tuple[Case, ...]
    judge: Callable[[Shot], Figures]  # of one take
    summary: Callable[[Sequence[Shot], Sequence[Figures]], Figures]  # of all takes of a case
    bars: tuple[Bar, ...]
    across: Callable[[Rows, Shots], dict[tuple[str, str], Figures]] = nothing_more
    # rows that need several cases or sources
    least: int = 2  # agents of a case, in the smallest trial, too
    worst: str = ""  # figure whose largest value marks the worst take, for the pictures
    strip: Callable[[Shot], Take] = lambda shot: shot.take[
        : 4 * FPS
    ]  # the part of a take that is drawn


def part(take: Take, start: float, stop: float) -> Take:
    """The part of a take between two seconds, clipped to the take; at least a frame."""
    first = min(max(round(start * FPS), 0), len(take) - 1)
    return take[first : max(round(stop * FPS), first + 1)]


def spread(each: Sequence[Figures], **wanted: str) -> Figures:
    """Figures of a row from those of its takes: `name="mean of figure"`, or a quantile such as
    `p95 of`, `max of`, `min of`, `median of`. NaN takes are left out.
    """
    row = {}
    for name, rule in wanted.items():
        how, _, figure = rule.partition(" of ")
        values = [figures[figure] for figures in each]
        row[name] = mean(values) if how == "mean" else quantile(values, QUANTILES[how])
    return row


QUANTILES: Final = {
    "min": 0.0, "p5": 0.05, "p10": 0.1, "median": 0.5, "p90": 0.9, "p95": 0.95, "max": 1.0,
}  # fmt: skip


def pooled(values: Sequence[Array], at: float) -> float:
    """Quantile of all values of several arrays; NaN without any."""
    every = np.concatenate([np.zeros(0), *values])
    return float(np.quantile(every, at)) if len(every) else nan


def way_to(angle: float, metres: float, speed: float = 1.2, **how: Any) -> Plan:
    """One goal `metres` away, `angle` degrees to the left of straight ahead."""

    def plan(agent: AgentInfo) -> list[Goal]:
        ahead, left = metres * cos(radians(angle)), metres * sin(radians(angle))
        return [Goal(relative(agent, ahead, left), speed=speed, **how)]

    return plan


def facing(agent: AgentInfo, turn: float) -> Goal:
    """The agent's own place, with a heading `turn` degrees further to the left."""
    x, y, _ = agent.position
    return Goal((x, y, 0.0), heading=(agent.heading + radians(turn) + pi) % (2 * pi) - pi)
