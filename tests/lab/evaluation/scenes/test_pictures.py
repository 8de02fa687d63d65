"""Scenes drawn from above and seen by a camera."""

from pathlib import Path

import numpy as np
from PIL import Image

from tests.lab.evaluation.people import ANNY
from tests.lab.evaluation.scenes.test_monitor import chunk, scene
from wayfarer.navigation.examples import two_storeys
from wayfarer.navigation.scene import bake
from wayfarer.navigation.scene_spec import Box
from wayfarer.world.agents.agent import AgentSpec
from wayfarer_lab.evaluation.scenes.monitor import SceneMonitor
from wayfarer_lab.evaluation.scenes.pictures import Focus, plan, save, view

BOX = Box((4.0, 4.0), (4.0, 4.0), 1.0)


def pixels(image: Image.Image) -> np.ndarray:
    return np.asarray(image.convert("RGB")).astype(int)


def test_from_above_north_is_up_and_each_kind_of_ground_has_its_colour() -> None:
    drawn = pixels(plan(scene(BOX), [], 200))  # 20 m: a pixel is 10 cm
    box, floor, edge = drawn[60, 140], drawn[150, 50], drawn[100, 1]
    assert not np.array_equal(box, floor) and not np.array_equal(floor, edge)
    assert (drawn[60, 141] == box).all() and (drawn[140, 60] == floor).all()
    assert floor[1] > floor[0], "where one can walk it is green"


def test_ways_and_obstacles_are_drawn() -> None:
    way = np.column_stack([np.linspace(-8, 8, 30), np.full(30, -5.0), np.zeros(30)])
    bare, walked = (pixels(plan(scene(), ways, 200)) for ways in ([], [way]))
    rows = np.unique(np.argwhere((bare != walked).any(-1))[:, 0])
    assert len(rows) and abs(rows - 150).max() <= 4
    crate = pixels(plan(scene().put("crate", Box((0.0, 5.0), (1.0, 1.0), 1.0)), [], 200))[50, 100]
    assert crate[0] > crate[2] + 30, "brown"


def test_an_upper_storey_covers_the_lower_and_is_darker() -> None:
    drawn = pixels(plan(bake(two_storeys()), [], 240))  # 12 x 8 m
    below, gallery = drawn[80, 40], drawn[80, 200]
    assert gallery.sum() < below.sum() - 60


def test_a_view_shows_boxes_and_people_as_they_were(tmp_path: Path) -> None:
    place, seen = scene(BOX), []
    for agents in ((), ("a",)):
        monitor = SceneMonitor(ANNY, place)
        for agent in agents:
            monitor.meet(agent, AgentSpec())
            monitor.see(chunk(agent, 0, (0.0, 0.0, 0.0)))
        seen.append(view(place, monitor, Focus((0.0, 0.0), 6.0), (160, 120)))
    empty, peopled = map(pixels, seen)
    changed = np.argwhere((empty != peopled).any(-1))
    assert 100 < len(changed) < 6000, "one body and its shadow"
    bare = pixels(view(scene(), SceneMonitor(ANNY, scene()), Focus((0.0, 0.0), 6.0), (160, 120)))
    assert (bare != empty).any(-1).sum() > 300, "the box"
    save(tmp_path / "new" / "view.png", seen[1])
    assert Image.open(tmp_path / "new" / "view.png").size == (160, 120)
