"""A crowd with the same orders: how alike its people start and walk."""

from collections.abc import Sequence
from dataclasses import replace
from math import nan
from typing import Any, Final

import numpy as np

from wayfarer.spec import BETAS, FPS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer_lab.evaluation.figures import mean
from wayfarer_lab.evaluation.maneuvers.maneuver import (
    Bar,
    Case,
    Figures,
    Maneuver,
    MeasuredTake,
    case,
    pooled,
    way_to,
)
from wayfarer_lab.evaluation.maneuvers.walk import BRAKING, SPEEDING, start_seconds, steady
from wayfarer_lab.evaluation.metrics import crowd, feet, stride
from wayfarer_lab.evaluation.takes import Take

SPEED: Final = 1.2
METRES: Final = 12.0
SECONDS: Final = 8.0
FREE_FRAMES: Final = round((METRES - BRAKING) / SPEED * FPS)
"""Frames from the order on in which no one brakes yet."""

MIN_KNOWN: Final = 0.9
"""Share of the walkers whose phase has to be known."""


def _case(name: str, **body: Any) -> Case:
    """All face the same way; with one body they differ in their noise alone."""

    def placed(spec: AgentSpec, random: np.random.Generator) -> AgentSpec:
        return replace(spec, heading=0.0, **body)

    return case(name, SECONDS, lambda request: way_to(0.0, METRES, SPEED), placed=placed)


def measure_crowd(shot: MeasuredTake) -> Figures:
    """`start_s` from the order; the first foot."""
    foot = feet.first_foot(shot.take.height) if shot.goal is not None else None
    walked = _steps(shot)
    return {
        "start_s": nan if shot.goal is None else start_seconds(shot.take),
        "first_right": nan if foot is None else float(foot),
        "cadence": nan if walked is None else walked[0].cadence,
    }


def _steps(shot: MeasuredTake) -> tuple[stride.FootStrikes, int] | None:
    """Steps of the steady part, and the frame of the take at which that begins."""
    take, start = steady(shot), 0 if shot.goal is None else SPEEDING
    walked = None if take is None else stride.steps(take.ankles, take.hips)
    return None if walked is None else (walked, start)


def crowd_row(shots: Sequence[MeasuredTake], each: Sequence[Figures]) -> Figures:
    """Figures of all walkers; a person's gait cycle is the mean of all takes of that person.

    Phases count while those of nearly all are known: the few that are known soon after a strike
    are alike by choice.
    """
    cycles: dict[str, list[np.ndarray]] = {}
    phases = []
    for shot in shots:
        if (found := _steps(shot)) is None:
            continue
        walked, start = found
        strikes = walked.of(0) + start
        cycle = crowd.mean_cycle(np.asarray(shot.take.clip.rotations)[:, 1:], strikes)
        if cycle is not None:
            cycles.setdefault(shot.take.person, []).append(cycle)
        if shot.goal is not None:
            phases.append(_phase(shot.take))
    people = [crowd.mean_rotation(np.stack(found)) for found in cycles.values()]
    starts = np.array([figures["start_s"] for figures in each])
    starts = starts[~np.isnan(starts)]
    cadences = [f["cadence"] for f in each if not np.isnan(f["cadence"])]
    order = _order(np.stack(phases)) if phases else np.zeros(0)
    spread = pooled([starts], 0.95) - pooled([starts], 0.05) if len(starts) else nan
    return {
        "walkers": float(len(people)),
        "cycle_sd_deg": crowd.cycle_spread(people) if len(people) > 1 else nan,
        "phase_order": float(np.nanmean(order)) if np.isfinite(order).any() else nan,
        "start_spread_s": spread,
        "start_sd_s": float(starts.std()) if len(starts) else nan,
        "cadence_sd": float(np.std(cadences)) if cadences else nan,
        "right_first": mean([figures["first_right"] for figures in each]),
    }


def _phase(take: Take) -> np.ndarray:
    """The phase of a walk from 2 s on, by all its strikes; NaN where it is not known."""
    walked = stride.steps(take[:FREE_FRAMES].ankles, take[:FREE_FRAMES].hips)
    if walked is None:
        return np.full(FREE_FRAMES - SPEEDING, np.nan)
    return stride.phase(walked.of(0), FREE_FRAMES)[SPEEDING:]


def _order(phases: np.ndarray) -> np.ndarray:
    """`crowd.phase_order` [T] of phases [N, T], NaN while too few are known."""
    known = np.isfinite(phases).mean(0) >= MIN_KNOWN
    return np.where(known, crowd.phase_order(phases), nan)


CROWD: Final = Maneuver(
    name="crowd",
    about="the same goal 12 m ahead at 1.2 m/s for all; of one body, and of random ones",
    agents=32,
    cases=(
        _case("one body", gender="female", betas=(0.0,) * BETAS),
        _case("random bodies"),
    ),
    measure=measure_crowd,
    row=crowd_row,
    bars=(
        Bar("cycle_sd_deg", low=3, case="one body"),
        Bar("phase_order", high=0.4, case="one body"),
        Bar("start_spread_s", low=0.3, case="one body"),
    ),
    least=32,  # chance is 0.16 of order; of five people 0.4, which is the bar
    worst="start_s",
)
