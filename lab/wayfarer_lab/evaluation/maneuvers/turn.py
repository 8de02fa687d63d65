"""Turning on the spot by 90° and by 180°, to either side in turn."""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from wayfarer_lab.evaluation.maneuvers.feet_figures import (
    all_takes,
    contact_figures,
    stance_figures,
)
from wayfarer_lab.evaluation.maneuvers.maneuver import (
    Bar,
    Figures,
    Maneuver,
    MeasuredTake,
    Request,
    case,
    part,
    spread,
    turn_by,
)
from wayfarer_lab.evaluation.metrics import feet, joints
from wayfarer_lab.evaluation.tasks import Plan

SECONDS: Final = 6.0
ANGLES: Final = (30.0, 90.0, 180.0)
STEPPED: Final = (90.0, 180.0)
"""Angles that nobody turns by without a step."""

FACED: Final = 15.0
"""Degrees off its heading within which a person faces it, as docs/api.md promises."""


def to_either_side(angle: float) -> Callable[[Request], Plan]:
    """Turns to the left and to the right in turn, from agent to agent and from order to order."""
    return lambda request: turn_by(angle * (-1) ** (request.agent + request.order))


def measure_turn(shot: MeasuredTake) -> Figures:
    """Figures of one turn."""
    take = shot.take
    turned = take.heading - take.heading[0]
    rate = joints.turning_rate(take.heading)
    lifts = feet.lift_count(take.height)
    final = float(turned[-1])
    target = final if shot.goal is None else _target_turn(shot)
    apart = np.linalg.norm(take.hips[:, :2] - take.hips[0, :2], axis=-1)
    return {
        "turned_deg": abs(final),
        "error_deg": abs(final - target),
        "faces": float(abs(final - target) <= FACED),
        "lifts": float(lifts),
        "no_lift": float(lifts == 0),
        "pivot_deg": feet.pivot(take.stances),
        "peak_deg_s": float(np.abs(rate).max()),
        "turn_s": joints.turn_seconds(turned * np.sign(final), abs(final)),
        "drift_cm": 100 * float(apart.max()),
        "tilt_max_deg": float(take.tilt.max()),
        "knee_max_deg": float(take.knees.max()),
    }


def _target_turn(shot: MeasuredTake) -> float:
    """Degrees from the first heading to the target, on the side of the turn."""
    assert shot.goal is not None and shot.goal.heading is not None
    first, last = shot.take.heading[0], shot.take.heading[-1]
    target = float(np.degrees(shot.goal.heading)) - first
    return target + 360 * round((last - first - target) / 360)


def turn_row(shots: Sequence[MeasuredTake], each: Sequence[Figures]) -> Figures:
    """Means over people, the peak also of the 95th percentile."""
    return (
        spread(
            each,
            lifts="mean of lifts",
            no_lift="mean of no_lift",
            pivot_deg="mean of pivot_deg",
            peak_deg_s="mean of peak_deg_s",
            peak_deg_s_p95="p95 of peak_deg_s",
            turn_s="median of turn_s",
            turned_deg="mean of turned_deg",
            error_deg_median="median of error_deg",
            faces="mean of faces",
            drift_cm="mean of drift_cm",
            tilt_max_deg="mean of tilt_max_deg",
        )
        | stance_figures(all_takes(shots))
        | contact_figures(all_takes(shots))
    )


def _bars(angle: float) -> list[Bar]:
    case = f"{angle:g}°"
    steps = [Bar("no_lift", high=0, case=case)] if angle in STEPPED else []
    return [
        *steps,
        Bar("airborne_share", high=0.01, case=case, origin="a hop is no step"),
        Bar("faces", low=0.95, case=case, origin="docs/api.md: heading"),
    ]


TURN = Maneuver(
    name="turn",
    about="facing 30°, 90° or 180° elsewhere on the spot, to the left and to the right in turn",
    agents=48,
    cases=tuple(case(f"{angle:g}°", SECONDS, to_either_side(angle)) for angle in ANGLES),
    measure=measure_turn,
    row=turn_row,
    bars=tuple(bar for angle in ANGLES for bar in _bars(angle)),
    worst="pivot_deg",
    strip=lambda shot: part(shot.take, 0.0, 3.0),
)
