"""Pictures of motion, from results that were made by hand."""

import json

import numpy as np
import pytest
from PIL import Image

from wayfarer.body.library import load_body
from wayfarer.errors import DataError
from wayfarer_lab.evaluation.commands.paper import draw_figures
from wayfarer_lab.evaluation.paper.draw import CELL, LABEL, pictures
from wayfarer_lab.evaluation.pictures.paper import GOAL, LEFT


def body(x: float) -> list[list[float]]:
    """A T-pose, moved along x."""
    places = load_body("anny52", "female", "low").rest_joints(np.zeros(10))[:22]
    return (places + np.array([x, 0, 0])).round(3).tolist()


def motion(name: str, reached: bool = True) -> dict:
    return {"name": name, "joints": [body(0), body(1), body(2)], "goal": [3, 0], "reached": reached}


def figures(**changes) -> dict:
    seeded = {"name": "ro-2f", "seed": [body(0)], "ends": [body(0.1), body(0.2)]}
    return {"fig_4": [motion("policy")], "fig_s1": [seeded], "fig_s2": []} | changes


def inked(picture: Image.Image, ink: str) -> np.ndarray:
    """Columns that have some of a colour."""
    wanted = [int(ink[k : k + 2], 16) for k in (1, 3, 5)]
    return np.flatnonzero((np.abs(np.array(picture) - np.array(wanted)).max(-1) < 40).any(0))


def test_a_row_of_primitives_is_the_seed_and_then_its_ends() -> None:
    made = pictures(figures())
    assert {*made} == {"fig_4", "fig_s1"}  # of nothing nothing is drawn
    row = made["fig_s1"]
    assert row.size == (LABEL + 3 * CELL[0], CELL[1])
    assert LABEL < inked(row, GOAL).min() < inked(row, GOAL).max() < LABEL + CELL[0]
    assert LABEL + CELL[0] < inked(row, LEFT).min()


def test_a_way_ends_in_colour_before_its_goal() -> None:
    made = pictures(figures())["fig_4"]
    assert inked(made, LEFT).mean() < inked(made, GOAL).mean()
    other = pictures(figures(fig_4=[motion("policy", reached=False)]))["fig_4"]
    assert np.array(made).tolist() != np.array(other).tolist()  # it says so


def test_a_result_is_drawn_beside_the_page(tmp_path) -> None:
    path = tmp_path / "figures.json"
    assert draw_figures(path, tmp_path / "images") == {}
    path.write_text(json.dumps({"figures": figures(), "meta": {}}))
    assert draw_figures(path, tmp_path / "images") == {
        "fig_s1": "paper_fig_s1.png",
        "fig_4": "paper_fig_4.png",
    }
    assert Image.open(tmp_path / "images" / "paper_fig_4.png").size[0] > LABEL
    path.write_text(json.dumps({"figures": {"fig_4": []}}))
    with pytest.raises(DataError, match=r"figures\.json: holds no motions to draw"):
        draw_figures(path, tmp_path / "images")
