"""Local mode in a scene: the server's ways around walls, and its choices among people."""

import json
import shutil
from dataclasses import fields

import numpy as np
import pytest

from tests.clients.web_scripts import node
from wayfarer.errors import InvalidArgument, Unreachable
from wayfarer.navigation.examples import EXAMPLES, cubes_field
from wayfarer.world.avoidance.avoid import avoid
from wayfarer.world.avoidance.kernel import Width
from wayfarer.world.avoidance.people import Aims, Float, Memory, People
from wayfarer.world.scenes.around import way_around
from wayfarer.world.scenes.lanes import lanes
from wayfarer.world.scenes.passages import turns
from wayfarer_lab.engine_export.scene import read_scene, write_scene

CROWDS, WAYS, SECONDS = 100, 200, 0.2
REMEMBERED = tuple(field.name for field in fields(Memory))


def _vectors(rng: np.random.Generator, count: int) -> Float:
    return rng.normal(size=(count, 2)).astype(np.float32)


def _crowd(rng: np.random.Generator, count: int) -> People:
    """People near each other, some of them standing, waiting or making way."""
    retreat = _vectors(rng, count)
    waited, yields = rng.uniform(0, 3, count), rng.uniform(0, 1.6, count)
    walks, moves = rng.random(count) < 0.7, rng.random((count, 1)) < 0.7
    position, aims = 10 + 2 * _vectors(rng, count), Aims.empty(count)
    aims.wants[:], aims.spot[:] = walks, position + 5 * _vectors(rng, count)
    memory = Memory(
        preferred=_vectors(rng, count),
        chosen=_vectors(rng, count),
        waited=np.float32(waited * (rng.random(count) < 0.4)),
        yields=np.float32(yields * (rng.random(count) < 0.2)),
        retreat=retreat / np.linalg.norm(retreat, axis=-1, keepdims=True),
    )
    return People(
        number=np.arange(1, count + 1),
        group=np.zeros(count, int),
        position=position,
        height=np.zeros(count, np.float32),
        velocity=np.float32(0.7) * _vectors(rng, count) * moves,
        walks=walks,
        radius=np.full(count, 0.22, np.float32),
        memory=memory,
        aims=aims,
    )


def _sent(people: People, preferred: Float, left: Float, width: Width, ways: Float) -> list[dict]:
    return [
        {
            "number": int(people.number[k]),
            "position": people.position[k].tolist(),
            "velocity": people.velocity[k].tolist(),
            "walks": bool(people.walks[k]),
            "preferred": preferred[k].tolist(),
            "left": float(left[k]),
            "width": {"most": float(width.most[k]), "least": float(width.least[k])},
            "way": ways[k, :3].tolist(),
            "ahead": ways[k].tolist(),
            "aims": {"wants": bool(people.aims.wants[k]), "spot": people.aims.spot[k].tolist()},
            "memory": {name: getattr(people.memory, name)[k].tolist() for name in REMEMBERED},
        }
        for k in range(len(preferred))
    ]


def _around(room: np.ndarray) -> list[list[int]]:
    corners = np.empty((200, 2), np.int64)
    last = np.array(room.shape) - 1
    return corners[: way_around(room, np.zeros(2, np.int64), last, corners)].tolist()


@pytest.mark.skipif(not shutil.which("node"), reason="needs node: apt-get install nodejs")
def test_choices_and_ways_are_the_servers(tmp_path):
    rng = np.random.default_rng(11)
    scene = write_scene(cubes_field(), tmp_path / "scene")

    def clear(places: Float) -> Float:
        return scene.distance(np.concatenate([places, np.zeros((*places.shape[:2], 1))], -1))

    crowds, courses, kept, waiting = [], [], [], []
    for count in rng.integers(2, 14, CROWDS):
        people = _crowd(rng, count)
        angle, speed = rng.uniform(0, 2 * np.pi, count), rng.uniform(0.3, 1.6, count)
        preferred = np.float32(np.stack([np.cos(angle), np.sin(angle)], -1) * speed[:, None])
        left = rng.uniform(0, 9, count).astype(np.float32)
        width = Width(*rng.uniform(0.3, 2.0, (2, count)).astype(np.float32))
        points = people.position[:, None] + preferred[:, None] * np.arange(0.1, 4, 0.3)[:, None]
        crowds.append(_sent(people, preferred, left, width, points))
        courses.append(avoid(people, np.arange(count), preferred, clear, SECONDS, left, width))
        kept.append(lanes(people, np.arange(count), points[:, :3], clear))
        waiting.append(turns(people, np.arange(count), points, clear))
    ways, paths = [], []
    for x, y, to_x, to_y in rng.uniform(0, 20, (WAYS, 4)).tolist():
        try:
            paths.append(scene.path((x, y), (to_x, to_y)))
        except Unreachable:
            continue
        ways.append({"from": [x, y], "to": [to_x, to_y]})
    assert len(ways) > WAYS / 2
    rooms = [rng.uniform(-0.4, 1.0, (int(rows), 12)) for rows in rng.integers(6, 30, 40)]
    for number, room in enumerate(rooms):
        room[0, 0], room[-1, -1] = 0.5, 0.5 if number % 2 else -0.5
    grids = [{"room": room.ravel().tolist(), "columns": 12} for room in rooms]
    file = tmp_path / "crowds.json"
    file.write_text(json.dumps({"people": crowds, "ways": ways, "grids": grids}))
    found = json.loads(node("local_avoid.js", file, tmp_path / "scene"))

    pairs = [
        (one, course, k)
        for crowd, course in zip(found["chosen"], courses, strict=True)
        for k, one in enumerate(crowd)
    ]
    same = [
        np.allclose(one["velocity"], course.velocity[k], atol=1e-5)
        and all(
            np.allclose(one["memory"][name], getattr(course.memory, name)[k], atol=1e-5)
            for name in REMEMBERED
        )
        for one, course, k in pairs
    ]
    assert len(pairs) > 500
    found_lanes = [each for crowd in found["lanes"] for each in crowd]
    for name in Width._fields:
        theirs = np.array([each["width"][name] for each in found_lanes])
        mine = np.concatenate([getattr(lane.width, name) for lane in kept])
        np.testing.assert_allclose(theirs, mine, atol=1e-5, err_msg=name)
    for name in ("keeps", "place", "turn", "way"):
        theirs = np.array([each[name] for each in found_lanes])
        mine = np.concatenate([getattr(lane, name) for lane in kept])
        np.testing.assert_allclose(theirs, mine, atol=1e-5, err_msg=name)
    assert sum(each["keeps"] for each in found_lanes) > 10
    found_turns = [each for crowd in found["turns"] for each in crowd]
    waits = np.concatenate([turn.waits for turn in waiting])
    assert [bool(each) for each in found_turns] == waits.tolist() and waits.sum() > 10
    for name in ("place", "there"):
        theirs = np.array([each[name] for each in found_turns if each])
        mine = np.concatenate([getattr(turn, name)[turn.waits] for turn in waiting])
        np.testing.assert_allclose(theirs, mine, atol=1e-5, err_msg=name)
    assert same.count(False) <= 1  # costs that differ by EVEN itself may fall either way
    around = [_around(room) for room in rooms]
    assert found["around"] == around and sum(len(corners) > 2 for corners in around) > 10
    for path, way in zip(paths, found["ways"], strict=True):
        np.testing.assert_allclose(way["points"], path.points[:, :2], atol=1e-6)
        assert abs(path.goal_moved - way["moved"]) < 1e-6


@pytest.mark.parametrize("name", ["nowhere", "level.gltf"])
def test_a_scene_that_is_not_there_is_told(name):
    with pytest.raises(InvalidArgument, match=r"there is no scene .* town_square"):
        read_scene(name)


@pytest.mark.parametrize("name", ["slope_with_steps", "two_storeys"])
def test_floors_that_local_mode_cannot_walk_on_are_told(tmp_path, name):
    with pytest.raises(InvalidArgument, match="one level floor"):
        write_scene(EXAMPLES[name](), tmp_path / "scene")
    assert not (tmp_path / "scene").exists()
