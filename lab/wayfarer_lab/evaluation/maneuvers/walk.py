"""Steady walks straight ahead at 0.4 to 2.5 m/s: pace, rhythm, posture, and swing of body parts."""

from collections.abc import Sequence
from math import nan
from typing import Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer_lab.evaluation.figures import distances, first, smooth_speed
from wayfarer_lab.evaluation.maneuvers.feet_figures import contact_figures, stance_figures
from wayfarer_lab.evaluation.maneuvers.maneuver import (
    RECORDED,
    Bar,
    Case,
    Figures,
    Maneuver,
    MeasuredTake,
    MeasuredTakes,
    Request,
    Rows,
    case,
    part,
    spread,
    way_to,
)
from wayfarer_lab.evaluation.metrics import feet, joints, stride
from wayfarer_lab.evaluation.metrics.spectrum import BANDS, band_power
from wayfarer_lab.evaluation.takes import HEAD, LIMBS, SHOULDERS, WRISTS, Take
from wayfarer_lab.evaluation.tasks import Plan

SPEEDS: Final[dict[str, tuple[float, float]]] = {
    "0.4 m/s": (0.3, 0.5),
    "0.6 m/s": (0.5, 0.7),
    "0.8 m/s": (0.7, 0.9),
    "1.0 m/s": (0.9, 1.1),
    "1.1-1.5 m/s": (1.1, 1.5),
    "1.6 m/s": (1.5, 1.7),
    "1.8 m/s": (1.7, 1.9),
    "2.0 m/s": (1.9, 2.2),
    "2.5 m/s": (2.2, 2.8),
}
"""Target speeds, and the speeds of the recorded stretches compared with them."""

USUAL: Final = "1.1-1.5 m/s"
"""People's own speed: the bars are for it, and as many walk it as all others but one."""

SPEEDING: Final = 2 * FPS
"""Frames after the order that are no part of a steady walk."""

BRAKING: Final = 2.0
"""Metres before the goal that are no part of a steady walk."""

MIN_FRAMES: Final = round(1.5 * FPS)
"""Frames of a steady walk that is measured."""

MOVING: Final = 0.3
"""Metres per second: an agent that is faster has started."""

SAME_SPEED: Final = 0.1
"""Metres per second: power grows with speed, so only like is compared with like."""

POWERS: Final = [f"{low:g}_{high:g}_hz" for low, high in BANDS]


def _case(name: str) -> Case:
    low, high = SPEEDS[name]
    usual = name == USUAL

    def plan(request: Request) -> Plan:
        speed = float(request.random.uniform(low, high)) if usual else (low + high) / 2
        return way_to(0.0, max(12.0, 7.0 * speed), round(speed, 3))

    # the slowest need the longest
    return case(name, min(16.0, 12.0 / low), plan, share=1.0 if usual else 1 / 3)


def steady(shot: MeasuredTake) -> Take | None:
    """The part between starting and braking; None when there is too little of it."""
    take = shot.take
    if shot.goal is not None:
        end = first(distances(take.hips, shot.goal) <= BRAKING) or len(take)
        take = take[SPEEDING:end]
    return take if len(take) >= MIN_FRAMES else None


def pace(shot: MeasuredTake) -> float:
    """Way made toward the goal while a walk is steady ÷ what is asked; NaN without a goal,
    or where there is no steady walk.

    Unlike other figures it also counts people that stand when they should walk.
    """
    if shot.goal is None:
        return nan
    off = distances(shot.take.hips, shot.goal)
    end = first(off <= BRAKING) or len(off) - 1
    if end <= SPEEDING:
        return nan
    return float(off[SPEEDING] - off[end]) / (shot.goal.speed * (end - SPEEDING) / FPS)


def start_seconds(take: Take) -> float:
    """Seconds until a standing agent has started; NaN if it never does."""
    moving = first(smooth_speed(take.hips, 0.2) > MOVING)
    return nan if moving is None else moving / FPS


def measure_walk(shot: MeasuredTake) -> Figures:
    """Figures of the steady part, and of the start: `first_right`, `start_s`."""
    began = feet.first_foot(shot.take.height) if shot.goal is not None else None
    row: Figures = {
        "wished_mps": nan if shot.goal is None else shot.goal.speed,
        "pace": pace(shot),
        "first_right": nan if began is None else float(began),
        "start_s": nan if shot.goal is None else start_seconds(shot.take),
    }
    take = steady(shot)
    walked = None if take is None else stride.steps(take.ankles, take.hips)
    if take is None or walked is None:
        return row | dict.fromkeys(GAIT, nan)
    return row | gait(take, walked)


def gait(take: Take, walked: stride.FootStrikes) -> Figures:
    """Figures of a steady, straight walk."""
    along, left = stride.way(take.hips)
    around = walked.stride_frames
    hips = take.hips
    knees = [stride.extremes(take.knees[:, foot], walked.of(foot)) for foot in (0, 1)]
    arms = []
    for foot, (shoulder, wrist) in enumerate(zip(SHOULDERS, WRISTS, strict=True)):
        swing = stride.swing(take.joints[:, shoulder], take.joints[:, wrist], along)
        low, high = stride.extremes(swing, walked.of(1 - foot))
        arms.append(high - low)
    lengths = [walked.length[walked.feet[1:] == foot].mean() for foot in (0, 1)]
    power_of_limbs = band_power(take.joints[:, LIMBS] - take.joints[:, :1])
    speed = np.gradient(hips[:, :2] @ along) * FPS
    return {
        "speed_mps": float(np.linalg.norm(hips[-1, :2] - hips[0, :2])) * FPS / (len(take) - 1),
        "cadence": walked.cadence,
        "step_m": float(walked.length.mean()),
        "step_sd_cm": 100 * float(walked.length.std()),
        "width_cm": 100 * float(walked.width.mean()),
        "bob_cm": 100 * stride.oscillation(hips[:, 2], around),
        "lateral_cm": 100 * stride.oscillation(hips[:, :2] @ left, around),
        "surge_mps": stride.oscillation(speed, around),
        "trunk_deg": float(take.forward.mean()),
        "head_deg": float(joints.head_pitch(take.turns[:, HEAD]).mean()),
        "knee_min_deg": float(np.mean([low for low, _ in knees])),
        "knee_peak_deg": float(np.mean([high for _, high in knees])),
        "arm_left_deg": arms[0],
        "arm_right_deg": arms[1],
        "arm_left_wider": float(arms[0] > arms[1]),
        "double_support": feet.double_support(take.height),
        "step_asymmetry_pc": 100 * float(abs(lengths[0] - lengths[1]) / walked.length.mean()),
        "pop_cm": float(joints.pops(take.joints).max()),
    } | {
        f"{what}_{name}": float(value)
        for what, powers in (("hips", band_power(hips[:, None])), ("limbs", power_of_limbs))
        for name, value in zip(POWERS, powers, strict=True)
    }


GAIT: Final = (
    "speed_mps", "cadence", "step_m", "step_sd_cm", "width_cm", "bob_cm", "lateral_cm",
    "surge_mps", "trunk_deg", "head_deg", "knee_min_deg", "knee_peak_deg", "arm_left_deg",
    "arm_right_deg", "arm_left_wider", "double_support", "step_asymmetry_pc", "pop_cm",
    *(f"{what}_{name}" for what in ("hips", "limbs") for name in POWERS),
)  # fmt: skip


def walk_row(shots: Sequence[MeasuredTake], each: Sequence[Figures]) -> Figures:
    """Means over takes; slip and turn of all stances of all steady walks."""
    takes = [take for shot in shots if (take := steady(shot)) is not None]
    row = spread(
        each,
        **{name: f"mean of {name}" for name in (*GAIT, "start_s", "first_right")},
        measured="mean of bob_cm",
        pace="mean of pace",
        pace_p10="p10 of pace",
    )
    known = [figures for figures in each if not np.isnan(figures["cadence"])]
    row["measured"] = float(len(known))
    row["arm_sd_deg"] = float(np.std([f["arm_left_deg"] for f in known])) if known else nan
    row["right_first"] = row.pop("first_right")
    return row | (stance_figures(takes) | contact_figures(takes) if takes else {})


ALL: Final = "all speeds"
LIKE_PEOPLE: Final = f"{USUAL} ÷ recorded"


def across(rows: Rows, shots: MeasuredTakes) -> dict[tuple[str, str], Figures]:
    """The first foot at all speeds; power at the usual speed as a share of people's."""
    found: dict[tuple[str, str], Figures] = {}
    sources = dict.fromkeys(source for _, source in rows)
    for source in sources:
        if source.startswith(RECORDED):
            continue
        here = [(row["n"], row["right_first"]) for (_, s), row in rows.items() if s == source]
        known = [(n, share) for n, share in here if not np.isnan(share)]
        total = sum(n for n, _ in known)
        share = sum(n * share for n, share in known) / total if known else nan
        found[ALL, source] = {"n": total, "right_first": share}
    people = _measured(shots.get((USUAL, RECORDED), []))
    for source in sources:
        mine = _measured(shots.get((USUAL, source), []))
        if people and mine and not source.startswith(RECORDED):
            found[LIKE_PEOPLE, source] = power_shares(mine, people)
    return found


def _measured(shots: Sequence[MeasuredTake]) -> list[Figures]:
    return [
        figures for figures in map(measure_walk, shots) if not np.isnan(figures["limbs_6_10_hz"])
    ]


def power_shares(mine: Sequence[Figures], people: Sequence[Figures]) -> Figures:
    """Power in each band, of walks as a share of people's at the same speeds: each recorded walk
    is compared with our walk of the nearest speed, within 0.1 m/s.
    """
    speeds = np.array([figures["speed_mps"] for figures in mine])
    pairs = []
    for person in people:
        nearest = int(np.abs(speeds - person["speed_mps"]).argmin())
        if abs(speeds[nearest] - person["speed_mps"]) <= SAME_SPEED:
            pairs.append((mine[nearest], person))
    shares: Figures = {"pairs": float(len(pairs))}
    for name in (f"{what}_{band}" for what in ("hips", "limbs") for band in POWERS):
        total = sum(person[name] for _, person in pairs)
        shares[name] = sum(walk[name] for walk, _ in pairs) / total if pairs else nan
    return shares


WALK: Final = Maneuver(
    name="walk",
    about="straight ahead for 12 m and more, the steady part of it",
    agents=36,
    cases=tuple(_case(name) for name in SPEEDS),
    measure=measure_walk,
    row=walk_row,
    bars=(Bar("pace_p10", low=0.7), Bar("right_first", 0.4, 0.6, ALL)),
    across=across,
    worst="trunk_deg",
    strip=lambda shot: part(shot.take, 2.0, 4.5),
)
