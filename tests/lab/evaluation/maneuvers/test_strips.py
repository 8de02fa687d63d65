"""The takes that are drawn."""

from dataclasses import replace
from math import nan
from pathlib import Path

from PIL import Image

from tests.lab.evaluation.maneuvers.bodies import shot, take
from wayfarer_lab.evaluation.maneuvers import strips, turn
from wayfarer_lab.evaluation.maneuvers.run import Played


def test_the_worst_and_the_middle_one_are_drawn() -> None:
    assert strips.worst_and_middle([3.0, 1.0, nan, 9.0, 2.0]) == (3, 0)
    assert strips.worst_and_middle([nan, nan]) == (1, 1)
    assert strips.worst_and_middle([4.0]) == (0, 0)


def test_each_case_has_its_sheet(tmp_path: Path) -> None:
    played = Played(replace(turn.TURN, cases=turn.TURN.cases[:1]))
    played.add("30°", "sent", [shot(take(4.0), (0.0, 0.0), 0.0), shot(take(4.0), (0.0, 0.0), 0.0)])
    [sheet] = strips.draw(played, tmp_path)
    assert sheet.name == "turn_30.png"
    picture = Image.open(sheet)
    assert picture.width > strips.MOMENTS * 100 and picture.height > 2 * strips.HEIGHT
