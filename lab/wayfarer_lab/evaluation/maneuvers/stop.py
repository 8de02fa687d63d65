"""Coming to a stand: walks of 3 to 8 m at 0.6 to 2.0 m/s, and the posture after it."""

from collections.abc import Sequence
from math import pi
from typing import Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.heading import facing_at
from wayfarer_lab.evaluation.figures import degrees_off, distances, first
from wayfarer_lab.evaluation.maneuvers.feet_figures import contact_figures
from wayfarer_lab.evaluation.maneuvers.maneuver import (
    Bar,
    Figures,
    Maneuver,
    MeasuredTake,
    Request,
    case,
    part,
    spread,
    way_to,
)
from wayfarer_lab.evaluation.maneuvers.stand import arms
from wayfarer_lab.evaluation.metrics import feet, joints
from wayfarer_lab.evaluation.takes import HEAD, Take
from wayfarer_lab.evaluation.tasks import Plan

SPEEDS: Final = (0.6, 2.0)
METRES: Final = (3.0, 8.0)
SECONDS: Final = 20.0

REST_SPEED: Final = 0.08
"""Horizontal speed (m/s) below which hips and ankles rest."""

REST_SECONDS: Final = 1.0
"""Seconds of rest after which a body has stopped."""

AFTER: Final = 2.0
"""Seconds from rest to the measurement of feet and knees: time for a closing step."""

REACH: Final = 2
"""Frames on either side over which speeds are taken."""

SLOWED: Final = 0.3
"""Speed of the hips (m/s) below which a walk is over, and its settling begins."""

SETTLING: Final = 3.0
"""Seconds that settling lasts."""

HEEL_UP: Final = 0.02
"""Metres: a heel higher than this stands on its ball."""


def rest(take: Take) -> int | None:
    """The first frame from which hips and ankles rest for 1 s; None when they never do."""
    return next(iter(rests(take)), None)


def rests(take: Take) -> list[int]:
    """Every frame from which hips and ankles rest for 1 s."""
    places = np.concatenate([take.hips[:, None, :2], take.ankles[..., :2]], 1)
    way = np.linalg.norm(places[2 * REACH :] - places[: -2 * REACH], axis=-1)
    slow = np.zeros(len(take), bool)
    slow[REACH:-REACH] = (way * FPS / (2 * REACH) < REST_SPEED).all(-1)
    needed = round(REST_SECONDS * FPS)
    return [run.start for run in feet.runs(slow) if run.stop - run.start >= needed]


def _plan(request: Request, **how: float) -> Plan:
    metres, speed = request.random.uniform(*METRES), request.random.uniform(*SPEEDS)
    return way_to(0.0, float(metres), float(speed), **how)


def _faced(request: Request) -> Plan:
    return _plan(request, heading=float(request.random.uniform(-pi, pi)))


def _off_goal(take: Take, goal: Goal | None, moment: int) -> Figures:
    """How far a body is from its goal, and how far off the asked heading."""
    off = dict.fromkeys(("off_goal_cm", "off_heading_deg"), np.nan)
    if goal is not None:
        off["off_goal_cm"] = 100 * float(distances(take.hips[moment], goal))
        if goal.heading is not None:
            target = facing_at(goal.heading)
            off["off_heading_deg"] = float(degrees_off(take.facing[moment], target))
    return off


def _braked(shot: MeasuredTake) -> int:
    """The frame at which hips come within 0.75 m of the goal."""
    assert shot.goal is not None
    return first(distances(shot.take.hips, shot.goal) <= 0.75) or 0


def settling(take: Take) -> Figures:
    """Figures of a body after it has slowed."""
    way = np.linalg.norm(take.hips[2 * REACH :, :2] - take.hips[: -2 * REACH, :2], axis=-1)
    begun = first(way * FPS / (2 * REACH) < SLOWED)
    if begun is None:
        return dict.fromkeys(("sway_back_cm", "behind_cm", "lean_back_deg", "more_lifts"), np.nan)
    after = take[begun + REACH :][: round(SETTLING * FPS)]
    along = after.hips[:, :2] @ after.facing[0]
    ankles = np.einsum("tfi,ti->tf", after.ankles[..., :2], after.facing)
    behind = ankles.min(-1) - (after.hips[:, :2] * after.facing).sum(-1)
    return {
        "sway_back_cm": 100 * float((np.maximum.accumulate(along) - along).max()),
        "behind_cm": 100 * float(behind.max()),
        "lean_back_deg": float(-after.forward.min()),
        "more_lifts": float(feet.lift_count(after.height)),
    }


def measure_stop(shot: MeasuredTake) -> Figures:
    """Figures of one stop. An agent that never rests is measured at the end."""
    take = shot.take
    start = 0 if shot.goal is None else _braked(shot)
    begun = rest(take[start:])
    moment = len(take) - 1
    if begun is not None:
        moment = min(start + begun + round(AFTER * FPS), len(take) - 1)
    heels = take.soles[moment, :, 0, 2] - take.soles[moment, ..., 2].min()
    stop = take[start:]
    moved = 0.0
    if begun is not None:
        after = take.ankles[start + begun :, :, :2]
        moved = float(np.linalg.norm(after[-1] - after[0], axis=-1).max())
    return (
        {
            "rests": float(begun is not None),
            "rest_s": np.nan if begun is None else begun / FPS,
            "apart_cm": 100 * float(joints.apart_along(take.ankles[moment], take.facing[moment])),
            "heel_up": float(heels.max() > HEEL_UP),
            "heel_cm": 100 * float(heels.max()),
            "knee_deg": float(take.knees[moment].max()),
            "head_deg": float(joints.head_pitch(take.turns[moment, HEAD])),
            "tilt_max_deg": float(stop.tilt.max()),
            "creep_cm": 100 * moved,
        }
        | settling(stop)
        | arms(take[moment : moment + 1])
        | _off_goal(take, shot.goal, moment)
    )


def the_stop(shot: MeasuredTake) -> Take:
    """The part from 2 s before rest, or before the end, until the measurement."""
    start = 0 if shot.goal is None else _braked(shot)
    begun = rest(shot.take[start:])
    seconds = (len(shot.take) if begun is None else start + begun) / FPS
    return part(shot.take, seconds - 2.0, seconds + AFTER)


def stop_row(shots: Sequence[MeasuredTake], each: Sequence[Figures]) -> Figures:
    """Quantiles and shares of all stops."""
    return spread(
        each,
        apart_cm_median="median of apart_cm",
        apart_cm_p90="p90 of apart_cm",
        heel_up="mean of heel_up",
        heel_cm_p90="p90 of heel_cm",
        off_goal_cm_median="median of off_goal_cm",
        off_goal_cm_p90="p90 of off_goal_cm",
        off_heading_deg_median="median of off_heading_deg",
        rests="mean of rests",
        rest_s_median="median of rest_s",
        rest_s_p90="p90 of rest_s",
        knee_deg="median of knee_deg",
        knee_deg_p90="p90 of knee_deg",
        hand_ahead_cm="median of hand_ahead_cm",
        hand_ahead_cm_p90="p90 of hand_ahead_cm",
        hands_apart_cm="median of hands_apart_cm",
        hands_apart_cm_p90="p90 of hands_apart_cm",
        head_deg="median of head_deg",
        creep_cm_p90="p90 of creep_cm",
        tilt_max_deg="mean of tilt_max_deg",
        sway_back_cm_median="median of sway_back_cm",
        sway_back_cm_p95="p95 of sway_back_cm",
        behind_cm_p95="p95 of behind_cm",
        lean_back_deg_p95="p95 of lean_back_deg",
        more_lifts="mean of more_lifts",
        more_lifts_p90="p90 of more_lifts",
    ) | contact_figures([shot.take for shot in shots])


STOP = Maneuver(
    name="stop",
    about="walks of 3 to 8 m at 0.6 to 2.0 m/s that end in a stand, looked at 2 s after rest",
    agents=96,
    cases=(case("at a goal", SECONDS, _plan), case("facing asked", SECONDS, _faced, share=1 / 3)),
    measure=measure_stop,
    row=stop_row,
    bars=(
        Bar("apart_cm_median", high=8, case="at a goal"),
        Bar("apart_cm_p90", high=15, case="at a goal"),
        Bar("heel_up", high=0.03, case="at a goal"),
        Bar("sway_back_cm_p95", high=8, case="at a goal"),
        Bar("behind_cm_p95", high=5, case="at a goal"),
    ),
    worst="apart_cm",
    strip=the_stop,
)
