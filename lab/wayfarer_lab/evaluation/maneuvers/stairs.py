"""Fifteen stairs of 20 cm up to a gallery, and down from it, at three target speeds."""

from collections.abc import Sequence
from dataclasses import replace
from math import nan, pi
from typing import Final

import numpy as np

from wayfarer.navigation.examples import two_storeys
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.figures import distances
from wayfarer_lab.evaluation.maneuvers.maneuver import (
    Bar,
    Case,
    Figures,
    Maneuver,
    MeasuredTake,
    Request,
    case,
    spread,
)
from wayfarer_lab.evaluation.metrics import feet, joints
from wayfarer_lab.evaluation.takes import Take
from wayfarer_lab.evaluation.tasks import Plan

SPEEDS: Final = (0.6, 1.2, 1.8)
"""Target speeds, m/s, in turn."""

FOOT: Final = 2.0
TOP: Final = 6.2
"""Metres along x at which the stairs of `two_storeys` begin and end; they lie at y < 1.8."""

SIDE: Final = 1.8
RISER: Final = 0.2
GALLERY: Final = 3.0
SECONDS: Final = 40.0

PLACED_SPEED: Final = 0.3
"""Speed (m/s) below which an ankle stands."""

PLACED_FRAMES: Final = 3
"""Frames after which a slow ankle counts as standing."""

PLACED_APART: Final = 0.10
"""Metres between two places of an ankle that are different steps."""


def _case(up: bool) -> Case:
    turn, (start, floor), goal = (
        (-pi / 2, (0.8, 0.0), (8.0, 1.0, GALLERY))
        if up
        else (pi / 2, (8.0, GALLERY), (0.8, 1.0, 0.0))
    )

    def placed(spec: AgentSpec, random: np.random.Generator) -> AgentSpec:
        lateral = float(random.uniform(0.6, 1.4))
        return replace(spec, position=(start, lateral), heading=turn, floor=floor)

    def plan(request: Request) -> Plan:
        return lambda agent: [Goal(goal, speed=SPEEDS[request.agent % len(SPEEDS)])]

    return case("up" if up else "down", SECONDS, plan, placed=placed, scene=two_storeys)


def placements(places: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """Frame and place of each time that an ankle [T, 3] comes to stand in another place."""
    speed = np.linalg.norm(np.gradient(places, axis=0), axis=-1) * FPS
    found: list[tuple[int, np.ndarray]] = []
    for run in feet.runs(speed < PLACED_SPEED):
        if run.stop - run.start < PLACED_FRAMES:
            continue
        place = places[run].mean(0)
        if not found or np.linalg.norm(place - found[-1][1]) > PLACED_APART:
            found.append((run.start, place))
    return found


def on_the_stairs(take: Take) -> slice | None:
    """Frames from the first to the last in which the hips are over the stairs."""
    x, y, _ = take.hips.T
    frames = np.flatnonzero((x > FOOT) & (x < TOP) & (y < SIDE))
    return slice(int(frames[0]), int(frames[-1]) + 1) if len(frames) > FPS // 4 else None


def the_climb(shot: MeasuredTake) -> Take:
    """The part on the stairs, brought down to the floor: pictures show no stairs."""
    climb = shot.take[on_the_stairs(shot.take) or slice(0, 4 * FPS)]
    places = np.array(climb.clip.translation)
    first, last = places[[0, -1], 2] - climb.hips_height
    places[:, 2] -= np.linspace(first, last, len(places))
    return replace(climb, clip=replace(climb.clip, translation=places))


def steps_per_riser(take: Take, part: slice) -> float:
    """Places where either foot comes to stand in a part of a take, over the risers between the
    lowest and the highest of them; NaN for less than three risers.
    """
    heights = np.array(
        [
            place[2]
            for ankles in np.moveaxis(take.ankles, 1, 0)
            for frame, place in placements(ankles)
            if part.start <= frame < part.stop
        ]
    )
    risers = np.ptp(heights) / RISER if len(heights) > 1 else 0.0
    # between the lowest and the highest place there is a step less than there are places
    return (len(heights) - 1) / risers if risers > 3 else nan


def measure_stairs(shot: MeasuredTake) -> Figures:
    """Figures of the part on the stairs."""
    take, part = shot.take, on_the_stairs(shot.take)
    end = nan if shot.goal is None else float(distances(take.hips[-1], shot.goal))
    row = {
        "wished_mps": nan if shot.goal is None else shot.goal.speed,
        "arrive": nan if shot.goal is None else float(end <= 0.3),
    }
    if part is None:
        return row | dict.fromkeys(FIGURES, nan)
    on = take[part]
    way = np.linalg.norm(np.diff(on.hips[:, :2], axis=0), axis=-1).sum()
    return row | {
        "steps_per_riser": steps_per_riser(take, part),
        "speed_mps": float(way) * FPS / max(len(on) - 1, 1),
        "knee_max_deg": float(on.knees.max()),
        "tilt_max_deg": float(on.tilt.max()),
        "float_share": float(feet.floating(on.height).mean()),
        "pop_cm": float(joints.pops(on.joints).max()),
    }


FIGURES: Final = (
    "steps_per_riser", "speed_mps", "knee_max_deg", "tilt_max_deg", "float_share", "pop_cm",
)  # fmt: skip


def stairs_row(shots: Sequence[MeasuredTake], each: Sequence[Figures]) -> Figures:
    """Means over takes, and the fastest of twenty people."""
    return spread(
        each,
        arrive="mean of arrive",
        steps_per_riser="mean of steps_per_riser",
        steps_per_riser_least="min of steps_per_riser",
        speed_mps="mean of speed_mps",
        speed_mps_p95="p95 of speed_mps",
        knee_max_deg="mean of knee_max_deg",
        knee_max_deg_worst="max of knee_max_deg",
        tilt_max_deg="mean of tilt_max_deg",
        float_share="mean of float_share",
        pop_cm="max of pop_cm",
    )


STAIRS: Final = Maneuver(
    name="stairs",
    about="15 stairs of 20 × 30 cm up and down; target speeds 0.6, 1.2, 1.8 m/s in turn",
    agents=18,
    cases=(_case(up=True), _case(up=False)),
    measure=measure_stairs,
    row=stairs_row,
    bars=(Bar("speed_mps_p95", high=0.7),),
    worst="knee_max_deg",
    strip=the_climb,
)
