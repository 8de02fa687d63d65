"""Dots of figures: what is drawn, and when nothing is."""

from pathlib import Path

import pytest
from matplotlib.figure import Figure
from PIL import Image

from wayfarer_lab.evaluation import charts
from wayfarer_lab.evaluation.gait import Row

ROWS: list[Row] = [
    {"name": "model", "score": 0.5, "score_q25": 0.4, "score_q75": 0.7, "windows": 3},
    {"name": "broken", "score": float("nan"), "windows": 0},
    {"name": "mocap", "score": 0.9, "windows": 7},
]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that are made."""
    made: list[Figure] = []

    class Kept(Figure):
        def __init__(self, **how: object) -> None:
            super().__init__(**how)
            made.append(self)

    monkeypatch.setattr(charts, "Figure", Kept)
    return made


def test_every_figure_that_is_no_count_gets_a_panel(tmp_path: Path, drawn: list[Figure]) -> None:
    charts.draw(tmp_path / "x.png", {"Gait": ROWS})
    (axes,) = drawn[0].axes
    assert axes.get_title() == "score", "neither whiskers nor counts"
    assert axes.collections[0].get_offsets()[:, 0].tolist() == [0.5, 0.9], "NaN is left out"
    assert Image.open(tmp_path / "x.png").size[0] > 300


def test_recordings_are_a_line_and_quartiles_whiskers(tmp_path: Path, drawn: list[Figure]) -> None:
    charts.draw(tmp_path / "x.png", {"Gait": ROWS})
    lines = [list(line.get_xdata()) for line in drawn[0].axes[0].lines]
    assert [0.4, 0.7] in lines and [0.9, 0.9] in lines


def test_chosen_figures_of_all_tables_are_drawn(tmp_path: Path, drawn: list[Figure]) -> None:
    charts.draw(tmp_path / "x.png", {"Gait": ROWS, "Standing": ROWS}, ["windows"])
    assert [axes.get_title() for axes in drawn[0].axes] == ["Gait: windows", "Standing: windows"]


def test_without_figures_there_is_no_picture(tmp_path: Path) -> None:
    charts.draw(tmp_path / "x.png", {"Gait": ROWS}, ["unknown"])
    assert not (tmp_path / "x.png").exists()
