"""How feet go: way and height of each lift, lifts for a metre and for a turn, knees in support and
in swing, weight before a first step. Definitions of lifts and stances: `feet.py`.

World space, metres, Z up, 40 fps. T frames; left comes before right.
"""

from math import nan
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS
from wayfarer_lab.evaluation.figures import first, smooth_speed
from wayfarer_lab.evaluation.metrics import feet

Array = NDArray[np.floating[Any]]

SETS_OFF: Final = 0.03
"""Metres per second: hips that are faster have begun to set off."""

MIN_DISTANCE: Final = 0.3
"""Metres that hips have to go before lifts for a metre mean anything."""

MIN_TURN: Final = 20.0
"""Degrees of a turn of which shares are taken at least."""


def travelled(hips: Array) -> float:
    """Length, metres, of the way of hips [T, 3], over half a second around each frame, so that
    sway does not count.
    """
    return float(smooth_speed(hips).sum()) / FPS


def lift_ways(ankles: Array, height: Array) -> list[float]:
    """Horizontal metres that an ankle [T, 2, 3] goes from lift to landing, for each lift."""
    return [
        float(np.linalg.norm(ankles[min(lift.stop, len(ankles) - 1), foot, :2]
                             - ankles[lift.start - 1, foot, :2]))
        for foot, mine in enumerate(feet.lifts(height))
        for lift in mine
        if lift.stop < len(ankles)
    ]  # fmt: skip


def lifts_per_metre(hips: Array, height: Array) -> float:
    """Lifts of both feet for a metre of the hips' way; NaN when they go less than .3 m."""
    metres = travelled(hips)
    return feet.lift_count(height) / metres if metres >= MIN_DISTANCE else nan


def lifts_per_second(height: Array) -> float:
    """Lifts of both feet a second."""
    return feet.lift_count(height) * FPS / len(height)


def lifts_per_quarter(heading: Array, height: Array) -> float:
    """Lifts of both feet for each 90° by which a heading [T] has turned at the end."""
    turned = abs(float(heading[-1] - heading[0]))
    return feet.lift_count(height) * 90 / turned if turned >= MIN_TURN else nan


def floor_turn_share(heading: Array, stances: list[feet.Stance]) -> float:
    """Share of a turn [T] that a foot turned on the floor while it bore, mean of both feet."""
    turned = abs(float(heading[-1] - heading[0]))
    return feet.pivot(stances) / turned if turned >= MIN_TURN else nan


def lead(ahead: Array, heading: Array) -> float:
    """Maximum degrees by which something is ahead of the pelvis in the first half of a turn.

    `ahead` [T] is its angle to the left of the pelvis, `heading` [T] the pelvis's.
    """
    turned = heading - heading[0]
    way = float(np.sign(turned[-1]))
    half = first(np.abs(turned) >= abs(turned[-1]) / 2) or len(turned) - 1
    return float((way * ahead[: half + 1]).max())


def knees_in_support(knees: Array, height: Array) -> float:
    """Median flexion, degrees, of a knee of [T, 2] while its foot alone bears; NaN: none does."""
    up = height > feet.LIFTED
    alone = ~up & up[:, ::-1]
    return float(np.median(knees[alone])) if alone.any() else nan


def seconds_before_lift(hips: Array, height: Array) -> float:
    """Seconds from when the hips [T, 3] begin to move until the first foot is up; NaN without.

    They begin after the last frame before that lift in which they are slower than 3 cm/s.
    """
    starts = [lift.start for mine in feet.lifts(height) for lift in mine]
    if not starts:
        return nan
    lift = min(starts)
    slow = np.flatnonzero(smooth_speed(hips, 0.2)[: lift + 1] < SETS_OFF)
    return (lift - int(slow[-1])) / FPS if len(slow) else nan


def footfalls(height: Array) -> float:
    """Times that a foot comes down."""
    return float(sum(lift.stop < len(height) for mine in feet.lifts(height) for lift in mine))
