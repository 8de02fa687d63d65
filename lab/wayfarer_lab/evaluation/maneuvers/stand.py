"""Standing for a minute: from the beginning, and after a short walk."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer_lab.evaluation.maneuvers.feet_figures import contact_figures
from wayfarer_lab.evaluation.maneuvers.maneuver import (
    Bar,
    Figures,
    Maneuver,
    MeasuredTake,
    Request,
    case,
    spread,
    way_to,
)
from wayfarer_lab.evaluation.metrics import feet, joints
from wayfarer_lab.evaluation.takes import WRISTS, Take
from wayfarer_lab.evaluation.tasks import Plan

SECONDS: Final = 60.0
WALK: Final = 10.0
"""Seconds after which a walk of 3 m has ended and standing is measured."""


def _walk(request: Request) -> Plan:
    return way_to(float(request.random.uniform(0, 360)), 3.0)


def the_stand(shot: MeasuredTake) -> Take:
    """The measured part."""
    return shot.take if shot.goal is None else shot.take[round(WALK * FPS) :]


def measure_stand(shot: MeasuredTake) -> Figures:
    """Figures of one stand."""
    take = the_stand(shot)
    slides = [100 * slide for slide in feet.slides(take.soles, take.height)]
    turns = [stance.turn for stance in take.stances]
    hips = take.hips[:, :2]
    middle = take.ankles[..., :2].mean(1)
    sway = np.linalg.norm(np.diff(hips, axis=0), axis=-1).mean() * FPS
    return {
        "seconds": len(take) / FPS,
        "slide_cm": max(slides, default=0.0),
        "foot_turn_deg": max(turns, default=0.0),
        "lifts": float(feet.lift_count(take.height)),
        "heading_range_deg": float(np.ptp(take.heading)),
        "drift_cm": 100 * float(np.linalg.norm(hips - hips[0], axis=-1).max()),
        "creep_cm": 100 * float(np.linalg.norm(middle[-1] - middle[0])),
        "sway_cm_s": 100 * float(sway),
        "knee_deg": float(take.knees.max(-1).mean()),
    } | arms(take)


def arms(take: Take) -> Figures:
    """Figures of the hands, means over a take of a standing body."""
    wrists = take.joints[:, WRISTS]
    ahead = 100 * joints.hands_ahead(wrists, take.hips, take.facing)
    return {
        "hand_ahead_cm": float(ahead.max(-1).mean()),
        "hands_apart_cm": float(np.ptp(ahead, axis=-1).mean()),
        "hand_up_cm": 100 * float(np.ptp(wrists[..., 2], axis=-1).mean()),
    }


def stand_row(shots: Sequence[MeasuredTake], each: Sequence[Figures]) -> Figures:
    """The bars are for the 95th percentile of people."""
    return spread(
        each,
        seconds="mean of seconds",
        slide_cm_p95="p95 of slide_cm",
        slide_cm_median="median of slide_cm",
        heading_range_deg_p95="p95 of heading_range_deg",
        heading_range_deg_mean="mean of heading_range_deg",
        foot_turn_deg_p95="p95 of foot_turn_deg",
        lifts="mean of lifts",
        drift_cm_p95="p95 of drift_cm",
        drift_cm_mean="mean of drift_cm",
        sway_cm_s="mean of sway_cm_s",
        knee_deg="mean of knee_deg",
        knee_deg_p90="p90 of knee_deg",
        hand_ahead_cm="median of hand_ahead_cm",
        hand_ahead_cm_p90="p90 of hand_ahead_cm",
        hands_apart_cm="median of hands_apart_cm",
        hands_apart_cm_p90="p90 of hands_apart_cm",
        hand_up_cm_p90="p90 of hand_up_cm",
    ) | contact_figures([the_stand(shot) for shot in shots])


_BARS: Final = [("slide_cm_p95", 1.0), ("heading_range_deg_p95", 8.0)]
_CASES: Final = ("at once", "after a walk")

STAND = Maneuver(
    name="stand",
    about="60 s without an order, from the beginning and after a walk of 3 m",
    agents=12,
    cases=(
        case("at once", SECONDS),
        case("after a walk", WALK + SECONDS, _walk),
    ),
    measure=measure_stand,
    row=stand_row,
    bars=tuple(Bar(name, high=high, case=case) for case in _CASES for name, high in _BARS),
    worst="slide_cm",
    strip=the_stand,
)
