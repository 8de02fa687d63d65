"""What people are asked to do without a world: where to be and what to face, frame by frame.

World space, metres, radians, Z up; heading 0 faces +Y; 40 fps.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS
from wayfarer_lab.evaluation.takes import Take
from wayfarer_lab.evaluation.twosided.figures import Values
from wayfarer_lab.evaluation.twosided.situations import BACK, CURVE, SIDE, SITUATIONS

Array = NDArray[np.floating[Any]]

SECONDS: Final = 12.0
AHEAD: Final = (8, 20, 40)
"""Frames after the last seed frame at which way and facing are wished: .2, .5 and 1 s."""

BEGIN: Final = 1.0
"""Seconds of standing before an order."""

PULL: Final = (0.1, 0.25, 0.5)
"""Share of the way back to its place of a person that stays there, at each of `AHEAD`."""

RADIUS: Final = 2.0
"""Metres, of the curve."""

MAX_PULL: Final = 0.15
"""Metres of the way back that are asked for at most."""


@dataclass(frozen=True)
class Wish:
    """What one person is asked for, over T + 40 frames and more."""

    heading: Array  # [N]
    velocity: Array  # [N, 2] world, m/s
    stays: bool  # whether it is sent back to its place
    parts: dict[str, list[slice]]  # by situation: frames that are measured

    def ways(self, frame: int, hips: Array) -> Array:
        """World displacements [3, 2] from frame `frame`, at which the hips [2] are."""
        places = np.concatenate([np.zeros((1, 2)), self.velocity.cumsum(0) / FPS])
        found = np.stack([places[frame + k] - places[frame] for k in AHEAD])
        if self.stays:
            off = places[frame] - hips
            off *= min(1.0, MAX_PULL / max(float(np.linalg.norm(off)), 1e-9))
            found = found + np.array(PULL)[:, None] * off
        return found

    def facings(self, frame: int) -> Array:
        """World unit vectors [3, 2]."""
        heading = self.heading[[frame + k for k in AHEAD]]
        return np.stack([-np.sin(heading), np.cos(heading)], -1)

    def measured(self, take: Take) -> dict[str, dict[str, float]]:
        """Figures by situation: of several parts the median, NaN left out."""
        return {
            name: median_values([SITUATIONS[name].measure(take[part]) for part in parts])
            for name, parts in self.parts.items()
        }


Order = Callable[[Array, np.random.Generator], Wish]
"""From times [N], s, and chance a wish of a person whose heading was 0."""


def _smooth_step(time: Array, start: float, seconds: float) -> Array:
    """0 before `start`, 1 after `start + seconds`, with the least jerk in between."""
    x = np.clip((time - start) / seconds, 0, 1)
    return x**3 * (10 - 15 * x + 6 * x * x)


def _part(start: float, stop: float) -> slice:
    return slice(round(start * FPS), round(stop * FPS))


def _still(time: Array) -> Array:
    return np.zeros((len(time), 2))


def stand(time: Array, random: np.random.Generator) -> Wish:
    """Stands where it is."""
    return Wish(0 * time, _still(time), True, {"stand": [_part(2.0, SECONDS)]})


def straight(name: str, speed: float, angle: float = 0.0, starts: bool = False) -> Order:
    """Goes at a speed, `angle` degrees to the left of what it faces."""

    def order(time: Array, random: np.random.Generator) -> Wish:
        way = np.radians(angle)
        speeds = speed * _smooth_step(time, BEGIN, 1.0)
        velocity = speeds[:, None] * np.array([-np.sin(way), np.cos(way)])
        parts = {name: [_part(4.0, SECONDS)]}
        if starts:
            parts["start"] = [_part(0.0, 3.5)]
        return Wish(0 * time, velocity, False, parts)

    return order


def turns(angle: float) -> Order:
    """Turns on the spot, to one side and back, each turn in its own time."""

    def order(time: Array, random: np.random.Generator) -> Wish:
        heading, parts, sign = 0 * time, [], float(random.choice([-1, 1]))
        for number, start in enumerate((1.5, 5.0, 8.5)):
            seconds = float(random.uniform(0.9, 1.6)) * (1 + (angle - 90) / 180)
            way = sign * (-1) ** number * np.radians(angle)
            heading = heading + way * _smooth_step(time, start, seconds)
            parts.append(_part(start - 0.3, start + seconds + 0.8))
        return Wish(heading, _still(time), True, {"turn": parts})

    return order


def turns_back(time: Array, random: np.random.Generator) -> Wish:
    """Walks at 1.2 m/s and turns round every 2 s, to either side by chance."""
    heading, parts = 0 * time, []
    for start in np.arange(3.0, SECONDS - 1.0, 2.0):
        seconds = float(random.uniform(0.8, 1.3))
        way = float(random.choice([-1, 1])) * pi
        heading = heading + way * _smooth_step(time, start, seconds)
        parts.append(_part(start - 0.5, min(start + 1.5, SECONDS)))
    facing = np.stack([-np.sin(heading), np.cos(heading)], -1)
    speed = 1.2 * _smooth_step(time, BEGIN, 1.0)
    return Wish(heading, speed[:, None] * facing, False, {"turn back": parts})


def curve(time: Array, random: np.random.Generator) -> Wish:
    """Walks at 1.2 m/s on a circle of 2 m of radius."""
    speed = CURVE * _smooth_step(time, BEGIN, 1.0)
    heading = float(random.choice([-1, 1])) * (speed / RADIUS).cumsum() / FPS
    facing = np.stack([-np.sin(heading), np.cos(heading)], -1)
    return Wish(heading, speed[:, None] * facing, False, {"curve": [_part(4.0, SECONDS)]})


def stop(time: Array, random: np.random.Generator) -> Wish:
    """Walks at 1.2 m/s and stops."""
    halt = float(random.uniform(5.0, 6.0))
    speed = 1.2 * (_smooth_step(time, BEGIN, 1.0) - _smooth_step(time, halt, 1.0))
    velocity = speed[:, None] * np.array([0.0, 1.0])
    return Wish(0 * time, velocity, False, {"stop": [_part(3.0, SECONDS)]})


ORDERS: Final[dict[str, Order]] = {
    "stand": stand,
    "walk 0.9": straight("walk 0.9", 0.9),
    "walk 1.2": straight("walk 1.2", 1.2, starts=True),
    "walk 1.5": straight("walk 1.5", 1.5),
    "left": straight("side", SIDE, 90.0),
    "right": straight("side", SIDE, -90.0),
    "back": straight("back", BACK, 180.0),
    "turn 90": turns(90.0),
    "turn 180": turns(180.0),
    "turn back": turns_back,
    "curve": curve,
    "stop": stop,
}
"""Orders by name; each is given to the same number of people."""


def median_values(rows: Sequence[Values]) -> Values:
    """Each figure's median over rows that have it; NaN left out."""
    found: Values = {}
    for figure in dict.fromkeys(name for row in rows for name in row):
        known = [row[figure] for row in rows if np.isfinite(row.get(figure, np.nan))]
        found[figure] = float(np.median(known)) if known else float("nan")
    return found
