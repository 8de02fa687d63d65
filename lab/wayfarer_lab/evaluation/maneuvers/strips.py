"""Pictures of manoeuvres: the worst and the median take of each case, moment by moment."""

import re
from dataclasses import replace
from math import isnan
from pathlib import Path
from typing import Final

import numpy as np

from wayfarer.body.library import load_body
from wayfarer.clips.clip import Clip
from wayfarer_lab.evaluation.maneuvers.maneuver import SENT, Figures, Maneuver
from wayfarer_lab.evaluation.maneuvers.run import Played
from wayfarer_lab.evaluation.pictures.files import write_still
from wayfarer_lab.evaluation.pictures.scene import ClipActor
from wayfarer_lab.evaluation.pictures.stills import contact_sheet
from wayfarer_lab.evaluation.takes import Take

MOMENTS: Final = 14
MAX_GOALS: Final = 4
HEIGHT: Final = 200
"""Pixels of a body's cell."""


def draw(played: Played, folder: Path) -> list[Path]:
    """One sheet for each case of what was sent: `MANEUVER_CASE.png`, written as they are made.

    Above the take in which the manoeuvre's `worst` figure is largest, below the median one.
    """
    maneuver, made = played.maneuver, []
    for case in maneuver.cases:
        shots = played.shots[case.name, SENT]
        each = played.figures[case.name, SENT]
        numbers = worst_and_middle([figures[maneuver.worst] for figures in each])
        takes = [maneuver.strip(shots[number]) for number in numbers]
        captions = [
            _caption(maneuver, word, take, each[number])
            for word, take, number in zip(("worst", "middle"), takes, numbers, strict=True)
        ]
        actors = [
            ClipActor.of(
                _few_goals(take.clip), load_body(take.clip.body, take.clip.gender), "sides"
            )
            for take in takes
        ]
        name = re.sub(r"[^0-9a-z.]+", "_", f"{maneuver.name} {case.name}".lower()).strip("_")
        made.append(folder / f"{name}.png")
        write_still(made[-1], contact_sheet(actors, captions, MOMENTS, height=HEIGHT))
    return made


def worst_and_middle(values: list[float]) -> tuple[int, int]:
    """Places of the largest value and of the median one; NaN sorts first."""
    order = np.argsort([-np.inf if isnan(value) else value for value in values], kind="stable")
    known = [int(k) for k in order if not isnan(values[k])] or [int(k) for k in order]
    return known[-1], known[len(known) // 2]


def _few_goals(clip: Clip) -> Clip:
    """The take without its goals: one every quarter of a second would hide the floor."""
    return replace(clip, goals=clip.goals if len(clip.goals) <= MAX_GOALS else ())


def _caption(maneuver: Maneuver, word: str, take: Take, figures: Figures) -> str:
    return (
        f"{word}: {take.name}, {take.clip.gender}, {maneuver.worst} {figures[maneuver.worst]:.3g}"
    )
