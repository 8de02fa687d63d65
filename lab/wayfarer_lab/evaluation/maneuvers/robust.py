"""Adversarial orders, such as repeated goals behind, and random sessions."""

from collections.abc import Sequence
from math import pi
from typing import Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.figures import distances
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
from wayfarer_lab.evaluation.metrics import feet, joints
from wayfarer_lab.evaluation.takes import Take
from wayfarer_lab.evaluation.tasks import Plan

TILTED: Final = 30.0
"""Degrees of the trunk: a walking person never leans so far."""

FOLDED: Final = 0.75
"""Share of the hips' full height below which a body squats."""

SUNK: Final = 0.03
"""Metres of a sole below the ground."""

ARRIVED: Final = 0.3
"""Metres from the goal, at the end of the take."""


def measure_robust(shot: MeasuredTake) -> Figures:
    """Worst moments of a take, and shares of its frames."""
    take = shot.take
    hips = take.hips[:, 2] / take.hips_height
    end = np.nan if shot.goal is None else float(distances(take.hips[-1], shot.goal))
    return {
        "over_30_deg": float((take.tilt > TILTED).mean()),
        "tilt_max_deg": float(take.tilt.max()),
        "hips_least": float(hips.min()),
        "folded": float((hips < FOLDED).any()),
        "pop_cm": float(joints.pops(take.joints).max()),
        "knee_least_deg": float(take.knees.min()),
        "knee_most_deg": float(take.knees.max()),
        "both_up": float(feet.floating(take.height).mean()),
        "sunk": float((take.height.min(-1) < -SUNK).mean()),
        "floats_seen": float(feet.floats_seen(take.height)),
        "lifts": float(feet.lift_count(take.height)),
        "pivot_deg": feet.pivot(take.stances),
        "root_step_cm": 100 * float(np.linalg.norm(np.diff(take.hips, axis=0), axis=-1).max()),
        "arrive": np.nan if shot.goal is None else float(end <= ARRIVED),
    }


def worst_moment(shot: MeasuredTake) -> Take:
    """Two seconds on either side of where the trunk leans the most."""
    moment = float(shot.take.tilt.argmax()) / FPS
    return part(shot.take, moment - 2.0, moment + 2.0)


def robust_row(shots: Sequence[MeasuredTake], each: Sequence[Figures]) -> Figures:
    """Means over all takes, and the worst of them."""
    return spread(
        each,
        over_30_deg="mean of over_30_deg",
        tilt_max_deg="max of tilt_max_deg",
        tilt_max_deg_mean="mean of tilt_max_deg",
        hips_least="min of hips_least",
        folded="mean of folded",
        pop_cm="max of pop_cm",
        pop_cm_mean="mean of pop_cm",
        knee_least_deg="min of knee_least_deg",
        knee_most_deg="max of knee_most_deg",
        both_up="mean of both_up",
        sunk="mean of sunk",
        floats_seen="mean of floats_seen",
        lifts="mean of lifts",
        pivot_deg="mean of pivot_deg",
        root_step_cm="max of root_step_cm",
        arrive="mean of arrive",
    ) | contact_figures([shot.take for shot in shots])


BARS: Final = (
    Bar("over_30_deg", high=0.001),
    Bar("hips_least", low=0.75),
    Bar("pop_cm", high=8),
    Bar("knee_least_deg", low=-5),
    Bar("knee_most_deg", high=150),
    Bar("sunk", high=0.001),
)


def _about_face(request: Request) -> Plan:
    """About-faces at the first place: away from the first heading and back."""
    turned = request.spec.heading + (pi if request.order % 2 == 0 else 0.0)
    goal = Goal((*request.spec.position, 0.0), heading=(turned + pi) % (2 * pi) - pi)
    return lambda agent: [goal]


def _anywhere(request: Request) -> Plan:
    random = request.random
    angle, metres = float(random.uniform(0, 360)), float(random.uniform(3.0, 9.0))
    return way_to(angle, metres, float(random.uniform(0.6, 2.5)))


SCRIPTS: Final = (
    case("3 m behind every 2 s", 40.0, lambda it: way_to(180.0, 3.0), every=2.0),
    case("3 m behind every 0.6 s", 30.0, lambda it: way_to(180.0, 3.0), every=0.6),
    case("about-face every 0.5 s", 30.0, _about_face, every=0.5),
    case("anywhere every 0.25 s", 30.0, _anywhere, every=0.25),
)
"""The adversarial scripts of the motion review."""

REVERSALS: Final = Maneuver(
    name="reversals",
    about="a goal 1.5 m behind, once; goals behind, about-faces and random goals again and again",
    agents=32,
    cases=(case("goal behind", 8.0, lambda it: way_to(180.0, 1.5)), *SCRIPTS),
    measure=measure_robust,
    row=robust_row,
    bars=BARS,
    worst="tilt_max_deg",
    strip=worst_moment,
)

RANDOM: Final = Maneuver(
    name="random",
    about="goals 3 to 9 m away in any direction, at 0.6 to 2.5 m/s: two of 11 s, or for 2 minutes",
    agents=96,
    cases=(
        case("two goals", 22.0, _anywhere, every=11.0),
        case("goal after goal", 120.0, _anywhere, every=10.0, share=1 / 3),
    ),
    measure=measure_robust,
    row=robust_row,
    bars=BARS,
    worst="tilt_max_deg",
    strip=worst_moment,
)
