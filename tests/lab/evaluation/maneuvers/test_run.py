"""All manoeuvres, played by people that only walk straight ahead."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

from tests.lab.evaluation.maneuvers.bodies import shot, walker
from wayfarer_lab.evaluation.commands.maneuvers import MANEUVERS
from wayfarer_lab.evaluation.maneuvers.likeness import AGAINST
from wayfarer_lab.evaluation.maneuvers.maneuver import RECORDED, Case, Maneuver, MeasuredTake
from wayfarer_lab.evaluation.maneuvers.run import Played, play
from wayfarer_lab.evaluation.maneuvers.table import judged
from wayfarer_lab.evaluation.maneuvers.walk import LIKE_PEOPLE
from wayfarer_lab.evaluation.tasks import Watch


class Walkers:
    """Everybody walks straight ahead in every test."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, str, int, bool]] = []

    def run(
        self, maneuver: str, case: Case, agents: int, raw: bool, watch: Watch
    ) -> list[MeasuredTake]:
        self.asked.append((maneuver, case.name, agents, raw))
        made = walker(12.0)
        made = replace(made, clip=replace(made.clip, goals=((0.0, 30.0, 0.0),)))
        return [shot(replace(made, person=f"agent {k}"), (0.0, 30.0), 0.0) for k in range(2)]


@contextmanager
def silent(title: str) -> Iterator[Watch]:
    yield lambda done, total: None


def recorded(maneuver: Maneuver) -> dict[tuple[str, str], list[MeasuredTake]]:
    made = walker(12.0)
    people = [shot(replace(made, person=f"person {k}")) for k in range(2)]
    return {(case.name, RECORDED): people for case in maneuver.cases}


def played(name: str, scale: float = 0.01) -> Played:
    [found] = play(Walkers(), [MANEUVERS[name]], scale, silent, recorded)
    return found


@pytest.mark.parametrize("name", MANEUVERS)
def test_every_bar_stands_beside_its_figure(name: str) -> None:
    """A bar whose figure is misspelt would never be judged."""
    found = played(name)
    verdicts = judged(MANEUVERS[name], found.rows)
    assert verdicts, "a manoeuvre without a bar is not needed"
    for verdict in verdicts:
        assert verdict.bar.figure in found.rows[verdict.case, "sent"], verdict
    assert {case for case, source in found.rows if source == RECORDED}
    assert len(found.each) == 6 * len(MANEUVERS[name].cases)


def test_each_case_is_played_as_sent_and_raw_with_its_share_of_agents() -> None:
    walkers = Walkers()
    list(play(walkers, [MANEUVERS["walk"]], 0.5, silent))
    asked = {case: agents for _, case, agents, raw in walkers.asked if raw}
    assert asked["1.1-1.5 m/s"] == 18 and asked["0.6 m/s"] == 6
    assert [raw for *_, raw in walkers.asked] == [False, True] * 9


def test_rows_that_need_recordings_are_there_with_them() -> None:
    assert played("walk").rows[LIKE_PEOPLE, "sent"]["limbs_6_10_hz"] == pytest.approx(1.0, abs=0.05)
    assert "auc" in played("likeness").rows[AGAINST, "sent"]
