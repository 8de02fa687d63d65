"""Walking sideways and backward: 2.5 m to a goal on that side, the heading kept."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer.world.agents.heading import facing_at
from wayfarer_lab.evaluation.figures import degrees_off, distances, first, smooth_speed
from wayfarer_lab.evaluation.maneuvers.feet_figures import contact_figures, stance_figures
from wayfarer_lab.evaluation.maneuvers.maneuver import (
    Bar,
    Case,
    Figures,
    Maneuver,
    MeasuredTake,
    MeasuredTakes,
    Rows,
    case,
    pooled,
    spread,
    strafe_to,
)
from wayfarer_lab.evaluation.metrics import feet, joints
from wayfarer_lab.evaluation.takes import HEAD, Take

METRES: Final = 2.5
SPEEDS: Final = (0.4, 0.6, 1.2)
"""Target speeds, m/s, in turn."""

ARRIVED: Final = 0.3
"""Metres from the goal at the end of the take, at most."""

SECONDS: Final = 12.0
SIDES: Final = {"left": 90.0, "right": -90.0, "back": 180.0}
"""Degrees to the left of straight ahead in which the goal lies."""


def _case(name: str, angle: float) -> Case:
    return case(name, SECONDS, lambda it: strafe_to(angle, METRES, SPEEDS[it.agent % len(SPEEDS)]))


def on_the_way(shot: MeasuredTake) -> Take:
    """The part until it arrives, at least 1 s; all of a recorded take."""
    if shot.goal is None:
        return shot.take
    near = first(distances(shot.take.hips, shot.goal) <= ARRIVED)
    return shot.take[: max(near or len(shot.take), FPS)]


def measure_strafe(shot: MeasuredTake) -> Figures:
    """`hips_…`: share of the hips' height in the T-pose."""
    take = on_the_way(shot)
    hips = take.hips[:, 2] / take.hips_height
    metres = float(np.linalg.norm(take.hips[-1, :2] - take.hips[0, :2]))
    lifts = feet.lift_count(take.height)
    end = np.nan if shot.goal is None else float(distances(shot.take.hips[-1], shot.goal))
    lean = joints.body_lean(take.ankles, take.joints[:, HEAD])
    return {
        "wished_mps": np.nan if shot.goal is None else shot.goal.speed,
        "speed_mps": float(np.median(smooth_speed(take.hips))),
        "hips_p5": float(np.quantile(hips, 0.05)),
        "hips_least": float(hips.min()),
        "lean_p95_deg": float(np.quantile(lean, 0.95)),
        "tilt_p95_deg": float(np.quantile(take.tilt, 0.95)),
        "float_share": float(feet.floating(take.height).mean()),
        "floats_seen": float(feet.floats_seen(take.height)),
        "contact_up": feet.false_contact(take.contacts, take.height),
        "lifts": float(lifts),
        "lifts_per_0.4_m": lifts * 0.4 / max(metres, 0.1),
        "arrive": np.nan if shot.goal is None else float(end <= ARRIVED),
        "end_m": end,
        "off_heading_p95_deg": _off_heading(shot, take),
    }


def _off_heading(shot: MeasuredTake, take: Take) -> float:
    if shot.goal is None or shot.goal.heading is None:
        return float("nan")
    return float(np.quantile(degrees_off(take.facing, facing_at(shot.goal.heading)), 0.95))


def strafe_row(shots: Sequence[MeasuredTake], each: Sequence[Figures]) -> Figures:
    """Quantiles and shares of hips, lean and soles are of all frames of all takes together."""
    takes = [on_the_way(shot) for shot in shots]
    lean = [joints.body_lean(take.ankles, take.joints[:, HEAD]) for take in takes]
    return (
        {
            "hips_p5": pooled([take.hips[:, 2] / take.hips_height for take in takes], 0.05),
            "lean_p95_deg": pooled(lean, 0.95),
        }
        | contact_figures(takes)
        | spread(
            each,
            arrive="mean of arrive",
            lifts_per_04_m="mean of lifts_per_0.4_m",
            speed_mps="mean of speed_mps",
            hips_least="min of hips_least",
            lean_worst_deg="max of lean_p95_deg",
            tilt_p95_deg="p95 of tilt_p95_deg",
            floats_seen="mean of floats_seen",
            off_heading_p95_deg="p95 of off_heading_p95_deg",
        )
        | stance_figures(takes)
    )


POINTS: Final = ("hips_p5", "float_share", "contact_up", "arrive")
"""Shares whose difference between left and right is counted, in points of 100."""


def across(rows: Rows, shots: MeasuredTakes) -> dict[tuple[str, str], Figures]:
    """Differences between left and right."""
    found = {}
    for source in dict.fromkeys(source for _, source in rows):
        left, right = rows.get(("left", source)), rows.get(("right", source))
        if left and right:
            apart = {f"{name}_points": 100 * abs(left[name] - right[name]) for name in POINTS}
            known = [value for value in apart.values() if not np.isnan(value)]
            apart["left_right_points"] = max(known, default=float("nan"))
            found["left against right", source] = apart
    return found


def _every_side(bar: Bar) -> list[Bar]:
    return [Bar(bar.figure, bar.low, bar.high, side, bar.origin) for side in SIDES]


STRAFE = Maneuver(
    name="strafe",
    about="2.5 m to the left, right, back, heading kept; target speeds 0.4, 0.6, 1.2 m/s in turn",
    agents=48,
    cases=tuple(_case(name, angle) for name, angle in SIDES.items()),
    measure=measure_strafe,
    row=strafe_row,
    bars=(
        *_every_side(Bar("hips_p5", low=0.90)),
        *_every_side(Bar("lean_p95_deg", high=12)),
        *_every_side(Bar("float_share", high=0.01)),
        *_every_side(Bar("contact_up", high=0.02)),
        *_every_side(Bar("arrive", low=0.95)),
        Bar("left_right_points", high=5, case="left against right"),
    ),
    across=across,
    worst="lean_p95_deg",
)
