"""Adversarial orders: goals behind, again and again; and random sessions."""

from collections.abc import Callable, Sequence
from math import pi
from typing import Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.figures import distances
from wayfarer_lab.evaluation.goals import Errand, Order, Plan, random_specs
from wayfarer_lab.evaluation.maneuvers.feet_figures import contact_figures
from wayfarer_lab.evaluation.maneuvers.maneuver import (
    Bar,
    Case,
    Figures,
    Maneuver,
    Shot,
    part,
    spread,
    way_to,
)
from wayfarer_lab.evaluation.metrics import feet, joints
from wayfarer_lab.evaluation.takes import Take

Chance = np.random.Generator

TILTED: Final = 30.0
"""Degrees of the trunk: a walking person never leans so far."""

FOLDED: Final = 0.75
"""Of the hips' full height: lower is a squat."""

ARRIVED: Final = 0.3
"""Metres from the goal, at the end of the take."""


def judge(shot: Shot) -> Figures:
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
        "floats_seen": float(feet.floats_seen(take.height)),
        "lifts": float(feet.lift_count(take.height)),
        "pivot_deg": feet.pivot(take.stances),
        "root_step_cm": 100 * float(np.linalg.norm(np.diff(take.hips, axis=0), axis=-1).max()),
        "arrive": np.nan if shot.goal is None else float(end <= ARRIVED),
    }


def worst_moment(shot: Shot) -> Take:
    """Two seconds on either side of where the trunk leans the most."""
    moment = float(shot.take.tilt.argmax()) / FPS
    return part(shot.take, moment - 2.0, moment + 2.0)


def summary(shots: Sequence[Shot], each: Sequence[Figures]) -> Figures:
    """Of all frames of all takes, and the worst of them."""
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
)


def repeated(
    name: str, every: float, seconds: float, plan: Callable[[int, AgentSpec, Chance], Plan]
) -> Case:
    """Periodic orders: `plan` makes each from its number, the agent and a random generator."""

    def errands(agents: int, random: np.random.Generator) -> list[Errand]:
        moments = [round(float(at), 3) for at in np.arange(0.0, seconds - 1e-6, every)]
        return [
            Errand(
                spec,
                tuple(Order(at, plan(number, spec, random)) for number, at in enumerate(moments)),
            )
            for spec in random_specs(agents, random)
        ]

    return Case(name, seconds, errands)


def _behind(metres: float) -> Callable[[int, AgentSpec, Chance], Plan]:
    return lambda number, spec, random: way_to(180.0, metres)


def _about_face(number: int, spec: AgentSpec, random: Chance) -> Plan:
    """About-faces at the first place: away from the first heading and back."""
    turned = spec.heading + (pi if number % 2 == 0 else 0.0)
    goal = Goal((*spec.position, 0.0), heading=(turned + pi) % (2 * pi) - pi)
    return lambda agent: [goal]


def _anywhere(number: int, spec: AgentSpec, random: Chance) -> Plan:
    angle, metres = float(random.uniform(0, 360)), float(random.uniform(3.0, 9.0))
    return way_to(angle, metres, float(random.uniform(0.6, 2.5)))


def _here(number: int, spec: AgentSpec, random: Chance) -> Plan:
    return lambda agent: [Goal((agent.position[0], agent.position[1], 0.0))]


def _by_turns(number: int, spec: AgentSpec, random: Chance) -> Plan:
    """A goal far ahead at 0.4 and at 3.0 m/s in turn."""
    return way_to(0.0, 12.0, (0.4, 3.0)[number % 2])


SCRIPTS: Final = (
    repeated("3 m behind every 2 s", 2.0, 40.0, _behind(3.0)),
    repeated("3 m behind every 0.6 s", 0.6, 30.0, _behind(3.0)),
    repeated("about-face every 0.5 s", 0.5, 30.0, _about_face),
    repeated("anywhere every 0.25 s", 0.25, 30.0, _anywhere),
)
"""The adversarial scripts of the motion review; `eval long` runs them, too."""

MORE_SCRIPTS: Final = (
    repeated("here every 0.25 s", 0.25, 30.0, _here),
    repeated("0.4 and 3 m/s in turn each second", 1.0, 30.0, _by_turns),
)
"""Scripts that never caused faults: in `eval long` only."""

REVERSALS: Final = Maneuver(
    name="reversals",
    about="a goal 1.5 m behind, once; goals behind, about-faces and random goals again and again",
    agents=32,
    cases=(repeated("goal behind", 8.0, 8.0, _behind(1.5)), *SCRIPTS),
    judge=judge,
    summary=summary,
    bars=BARS,
    worst="tilt_max_deg",
    strip=worst_moment,
)

RANDOM: Final = Maneuver(
    name="random",
    about="sessions of two goals 3 to 9 m away in any direction, at 0.6 to 2.5 m/s, 11 s each",
    agents=96,
    cases=(repeated("two goals", 11.0, 22.0, _anywhere),),
    judge=judge,
    summary=summary,
    bars=BARS,
    worst="tilt_max_deg",
    strip=worst_moment,
)
