"""Verdicts: figures that hold, and figures that do not."""

import numpy as np
import pytest

from wayfarer_lab.evaluation.twosided import verdicts
from wayfarer_lab.evaluation.twosided.ranges import Range
from wayfarer_lab.evaluation.twosided.verdicts import Person, verdicts_of

RANGES = {
    "stand": {"sway_cm": Range(1.0, 3.0, 2.0, 20, 5), "still_share": Range(0, 0.04, 0, 20, 5)}
}


def people(*sway: float, still: float = 0.0) -> list[Person]:
    return [
        Person("stand", f"{k}", {"sway_cm": value, "still_share": still})
        for k, value in enumerate(sway)
    ]


@pytest.mark.parametrize(
    ("sway", "text"),
    [
        ((1.2, 1.9, 2.6), "holds"),
        ((2.0, 2.0, 2.0), "alike"),
        ((0.1, 0.2, 2.5), "low"),
        ((3.1, 3.2, 9.0), "high"),
        ((np.nan, np.nan, 2.0), "not measured"),
    ],
)
def test_a_figure_holds_inside_and_not_alike(sway: tuple[float, ...], text: str) -> None:
    found = {v.figure: v for v in verdicts_of(people(*sway), RANGES)}
    assert found["sway_cm"].text == text and found["sway_cm"].holds == (text == "holds")


def test_shares_may_be_alike_and_a_statue_fails() -> None:
    found = {v.figure: v for v in verdicts_of(people(1.2, 1.9, 2.6), RANGES)}
    assert found["still_share"].holds
    statue = verdicts_of(people(0.0, 0.0, 0.0, still=1.0), RANGES)
    assert not any(v.holds for v in statue)
    assert str(verdicts.count(statue)) == "0 of 2 hold (0 medians inside)"


def test_given_ranges_ask_for_no_spread() -> None:
    given = {"side": {"speed_mps": Range(0.9, 1.1, 1.0, 0, 0)}}
    [found] = verdicts_of([Person("side", "a", {"speed_mps": 1.0})], given)
    assert found.holds


def test_situations_in_which_nobody_was_are_not_judged() -> None:
    assert verdicts_of([], RANGES) == []


def test_rows_have_verdicts_people_and_counts() -> None:
    some = people(1.2, 1.9, 2.6, np.nan)
    found = verdicts.rows_of(verdicts_of(some, RANGES), some)
    assert found["holds"] == 2 and found["of"] == 2
    assert found["people"][3]["sway_cm"] is None
