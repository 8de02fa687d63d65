"""Figures of feet that every manoeuvre has: slip and turn per stance, contact, floating."""

from collections.abc import Sequence

import numpy as np

from wayfarer_lab.evaluation.figures import mean, quantile
from wayfarer_lab.evaluation.maneuvers.maneuver import Figures, MeasuredTake, pooled
from wayfarer_lab.evaluation.metrics import feet
from wayfarer_lab.evaluation.takes import Take


def stance_figures(takes: Sequence[Take]) -> Figures:
    """Slip (cm) and turn (degrees) of all stances of all takes, median and p95, each foot apart
    in `…_left`, `…_right`; `lift_cm_p50`, the median height of lifts.
    """
    every = [stance for take in takes for stance in take.stances]
    side = np.array([stance.foot for stance in every])
    tops = [100 * top for take in takes for top in feet.lift_tops(take.height)]
    row = {"stances": float(len(every)), "lift_cm_p50": quantile(tops, 0.5)}
    for name, values in (
        ("slip_cm", 100 * np.array([stance.slip for stance in every])),
        ("stance_turn_deg", np.array([stance.turn for stance in every])),
    ):
        row[f"{name}_p50"], row[f"{name}_p95"] = (pooled([values], at) for at in (0.5, 0.95))
        for foot, which in enumerate(("left", "right")):
            row[f"{name}_p95_{which}"] = pooled([values[side == foot]], 0.95)
    return row


def contact_figures(takes: Sequence[Take]) -> Figures:
    """Of all frames: `float_share` (lower sole more than 3 cm up), `airborne_share` (neither foot
    bears: mean over takes); of contact flags: `contact_up` (that foot more than 2 cm up); of
    floating frames: `contact_floating` (any contact flag).
    """
    height = np.concatenate([take.height for take in takes])
    contacts = np.concatenate([take.contacts for take in takes])
    return {
        "float_share": float(feet.floating(height).mean()),
        "airborne_share": mean([feet.airborne(take.soles, take.height) for take in takes]),
        "contact_up": feet.false_contact(contacts, height),
        "contact_floating": feet.contact_while_floating(contacts, height),
    }


def all_takes(shots: Sequence[MeasuredTake]) -> list[Take]:
    """The takes of some shots."""
    return [shot.take for shot in shots]
