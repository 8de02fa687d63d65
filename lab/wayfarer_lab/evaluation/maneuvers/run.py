"""Plays manoeuvres one after the other, and measures each when it is over."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any, Protocol

from wayfarer_lab.evaluation.maneuvers.maneuver import (
    RAW,
    SENT,
    Case,
    Figures,
    Maneuver,
    MeasuredTake,
)
from wayfarer_lab.evaluation.tasks import Watch

Progress = Callable[[str], AbstractContextManager[Watch]]


class RunsCases(Protocol):
    """Interface of `case_runner.CaseRunner`."""

    def run(
        self, maneuver: str, case: Case, agents: int, raw: bool, watch: Watch
    ) -> list[MeasuredTake]:
        """Runs a case with a number of agents."""


Recorded = Callable[[Maneuver], Mapping[tuple[str, str], Sequence[MeasuredTake]]]
"""Recorded takes of a manoeuvre by (case, source)."""


def no_recordings(maneuver: Maneuver) -> Mapping[tuple[str, str], Sequence[MeasuredTake]]:
    """Without data: no takes."""
    return {}


@dataclass
class Played:
    """A finished manoeuvre."""

    maneuver: Maneuver
    shots: dict[tuple[str, str], Sequence[MeasuredTake]] = field(default_factory=dict)
    figures: dict[tuple[str, str], list[Figures]] = field(default_factory=dict)  # of each shot
    rows: dict[tuple[str, str], Figures] = field(default_factory=dict)
    each: list[dict[str, Any]] = field(default_factory=list)

    def add(self, case: str, source: str, shots: Sequence[MeasuredTake]) -> None:
        """Makes the row of a case, and the figures of each of its takes."""
        maneuver = self.maneuver
        each = [
            {name: float(value) for name, value in maneuver.measure(shot).items()} for shot in shots
        ]
        people = {shot.take.person for shot in shots}
        self.shots[case, source], self.figures[case, source] = shots, each
        self.rows[case, source] = {
            "n": float(len(shots)),
            "people": float(len(people)),
            **{name: float(value) for name, value in maneuver.row(shots, each).items()},
        }
        for shot, figures in zip(shots, each, strict=True):
            self.each.append(
                {
                    "maneuver": maneuver.name,
                    "case": case,
                    "source": source,
                    "take": shot.take.name,
                    "person": shot.take.person,
                    "gender": shot.take.clip.gender,
                    **{k: None if v != v else round(v, 4) for k, v in figures.items()},
                }
            )


def play(
    runner: RunsCases,
    chosen: Sequence[Maneuver],
    scale: float,
    progress: Progress,
    recorded: Recorded = no_recordings,
) -> Iterator[Played]:
    """Each manoeuvre with `scale` of its agents, as sent and by the model alone, and the recorded
    takes of it.
    """
    for maneuver in chosen:
        played = Played(maneuver)
        for case in maneuver.cases:
            agents = max(maneuver.least, round(maneuver.agents * case.share * scale))
            for source in (SENT, RAW):
                with progress(f"{maneuver.name} {case.name}, {source}") as watch:
                    shots = runner.run(maneuver.name, case, agents, source == RAW, watch)
                played.add(case.name, source, shots)
        for (name, source), takes in recorded(maneuver).items():
            played.add(name, source, takes)
        played.rows |= maneuver.across(played.rows, played.shots)
        yield played
