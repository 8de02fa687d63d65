"""Can a classifier distinguish sent walks from recorded ones? Matched in number and speed."""

from collections.abc import Sequence
from math import nan
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer_lab.evaluation.figures import mean
from wayfarer_lab.evaluation.maneuvers.maneuver import (
    RECORDED,
    Bar,
    Figures,
    Maneuver,
    MeasuredTake,
    MeasuredTakes,
    Request,
    Rows,
    case,
    part,
    way_to,
)
from wayfarer_lab.evaluation.maneuvers.walk import steady
from wayfarer_lab.evaluation.metrics import frechet, likeness
from wayfarer_lab.evaluation.tasks import Plan

Array = NDArray[np.floating[Any]]
People = tuple[Array, NDArray[np.int64]]
"""Features [W, 37] of windows, and whose each is [W]."""

CASE: Final = "straight walks"
SPEEDS: Final = (0.8, 1.6)
"""Target speeds, m/s."""

RANGE: Final = (0.9, 1.5)
"""Speeds of the compared windows, m/s."""

USED: Final = [k for k, name in enumerate(frechet.NAMES) if not name.endswith("height")]
"""Features left out: heights of body parts measure the person, not the walk."""

MIN_WINDOWS: Final = 40
"""Least number of windows of each kind."""

DRAWS: Final = 5
"""Random matched samples over which a figure is averaged."""


def _plan(request: Request) -> Plan:
    return way_to(0.0, 12.0, round(float(request.random.uniform(*SPEEDS)), 3))


def windows(shots: Sequence[MeasuredTake]) -> People:
    """All 2 s of steady walks at 0.9 to 1.5 m/s."""
    people = {person: k for k, person in enumerate(sorted({s.take.person for s in shots}))}
    takes = [(take, people[shot.take.person]) for shot in shots if (take := steady(shot))]
    names = takes[0][0].marker_names if takes else ()
    return windows_of([take.markers for take, _ in takes], [owner for _, owner in takes], names)


def windows_of(
    tracks: Sequence[Array], owners: Sequence[int], marker_names: Sequence[str]
) -> People:
    """All 2 s at 0.9 to 1.5 m/s of tracks of markers [T, M, 3], each with its owner."""
    found: list[Array] = [np.zeros((0, frechet.SIZE))]
    whose: list[NDArray[np.int64]] = [np.zeros(0, np.int64)]
    for markers, owner in zip(tracks, owners, strict=True):
        rows = frechet.features(markers, marker_names)
        speed = np.hypot(rows[:, 0], rows[:, 1])
        rows = rows[(speed >= RANGE[0]) & (speed < RANGE[1])]
        found.append(rows)
        whose.append(np.full(len(rows), owner))
    return np.concatenate(found), np.concatenate(whose)


def measure_likeness(shot: MeasuredTake) -> Figures:
    """How much of it there is."""
    rows, _ = windows([shot])
    return {"windows": float(len(rows))}


def likeness_row(shots: Sequence[MeasuredTake], each: Sequence[Figures]) -> Figures:
    """How much there is."""
    return {"windows": sum(figures["windows"] for figures in each)}


def compare(made: People, recorded: People) -> Figures:
    """AUC and Fréchet distance of two sets of windows, matched in number and speed."""
    areas, far, compared = [], [], 0
    for draw in range(DRAWS):
        random = np.random.default_rng(draw)
        speeds = [np.hypot(rows[:, 0], rows[:, 1]) for rows, _ in (made, recorded)]
        one, other = likeness.matched(speeds[0], speeds[1], random)
        compared = len(one)
        if compared < MIN_WINDOWS:
            return {"auc": nan, "frechet": nan, "compared": float(compared)}
        a, b = made[0][one][:, USED], recorded[0][other][:, USED]
        areas.append(likeness.told_apart(a, b, made[1][one], recorded[1][other]))
        scale = b.std(0) + 1e-6
        enough = compared >= frechet.MIN_WINDOWS
        far.append(frechet.frechet(a / scale, b / scale) if enough else nan)
    known = [area for area in areas if not np.isnan(area)]
    return {
        "auc": float(np.mean(known)) if known else nan,
        "frechet": float(np.mean(far)),
        "compared": float(compared),
    }


def _among(people: People) -> Figures:
    """Half of the people against the other half, mean over random halves: how far a classifier
    gets that sees nothing but that people differ.
    """
    rows, owners = people
    known = np.unique(owners)
    results = []
    for draw in range(DRAWS):
        some = np.random.default_rng(draw).permutation(known)[: len(known) // 2]
        one = np.isin(owners, some)
        results.append(compare((rows[one], owners[one]), (rows[~one], owners[~one])))
    return {name: mean([result[name] for result in results]) for name in results[0]}


def across(rows: Rows, shots: MeasuredTakes) -> dict[tuple[str, str], Figures]:
    """Ours against recorded people, people against other people, and by which features
    the first two differ, in standard deviations of the recorded ones.
    """
    found: dict[tuple[str, str], Figures] = {}
    people = windows(shots.get((CASE, RECORDED), []))
    for (_, source), mine in shots.items():
        if source.startswith(RECORDED):
            continue
        made = windows(mine)
        found[AGAINST, source] = compare(made, people)
        if len(made[0]) and len(people[0]):
            apart = (made[0].mean(0) - people[0].mean(0)) / (people[0].std(0) + 1e-6)
            found[DIFFERENCES, source] = {
                frechet.NAMES[k]: float(apart[k])
                for k in sorted(USED, key=lambda k: -abs(apart[k]))
            }
    if len(people[0]):
        found[AGAINST, RECORDED] = _among(people)
    return found


AGAINST: Final = "against recorded"
DIFFERENCES: Final = "differences (sd)"

LIKENESS: Final = Maneuver(
    name="likeness",
    about="a linear classifier on 2 s of straight walking at 0.9 to 1.5 m/s, and Fréchet distance",
    agents=64,
    cases=(case(CASE, 12.0, _plan),),
    measure=measure_likeness,
    row=likeness_row,
    bars=(Bar("auc", high=0.75, case=AGAINST),),
    across=across,
    worst="windows",
    strip=lambda shot: part(shot.take, 2.0, 4.5),
)
