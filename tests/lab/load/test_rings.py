"""The rings of the command, and the walking viewpoint."""

import asyncio
import itertools
import math
from types import SimpleNamespace

import pytest

from wayfarer.errors import InvalidArgument
from wayfarer.v1 import common_pb2, motion_pb2
from wayfarer_lab.load import rings
from wayfarer_lab.load.plan import LoadPlan
from wayfarer_lab.load.rings import MAX_RADIUS, LoadRing, WalkingViewpoint, parse_rings

TEXT = "full:3.4,part:6.7,root"


def test_rings_are_told_by_detail_and_radius():
    found = parse_rings(TEXT)
    assert found == (LoadRing("full", 3.4), LoadRing("part", 6.7), LoadRing("root", MAX_RADIUS))
    assert ",".join(ring.name for ring in found) == TEXT
    assert parse_rings("") == ()


@pytest.mark.parametrize(
    "wrong",
    [
        *("3,6,12", "full:", "near:3", "full:3;root", "full:x", "full:nan", "full:0"),
        *("full:-1", "full:6,root:3", "full,root", "full:1e9", "full:inf"),
        ",".join(f"full:{k}" for k in range(1, 10)),
    ],
)
def test_what_are_no_rings_is_refused(wrong):
    with pytest.raises(InvalidArgument) as error:
        parse_rings(wrong)
    assert error.value.field == "rings"


def test_a_plan_without_rings_has_no_camera():
    assert LoadPlan().viewpoint(0, print) is None


def test_the_same_seed_gives_the_same_way():
    plan = LoadPlan(rings=parse_rings(TEXT), area=30.0)
    first, again, other = (plan.viewpoint(number, print) for number in (1, 1, 2))
    places = [[viewpoint._place() for _ in range(9)] for viewpoint in (first, again, other)]
    assert places[0] == places[1] != places[2]
    assert all(math.hypot(place.x, place.z) <= 30.0 for place in places[0])


@pytest.fixture
def viewpoint(monkeypatch):
    """Goes from corner to corner of a square of 10 m, at 2 m/s, on a clock of 1 s a look."""
    seconds = itertools.count()
    monkeypatch.setattr(rings, "time", SimpleNamespace(monotonic=lambda: next(seconds)))
    monkeypatch.setattr(rings, "VIEWPOINTS_PER_S", 1e6)
    corners = itertools.cycle([(0, 0), (10, 0), (10, 10), (0, 10)])
    return lambda speed: WalkingViewpoint(
        parse_rings(TEXT),
        speed,
        lambda: common_pb2.Vector3(**dict(zip("xz", next(corners), strict=True))),
        print,
    )


async def taken(requests, count):
    return [await anext(requests) for _ in range(count)]


async def test_the_viewpoint_walks_from_place_to_place(viewpoint):
    requests = viewpoint(2.0).requests("s-1")
    opening, *moves = await taken(requests, 9)
    assert opening.open.session_id == "s-1"
    places = [move.viewpoints.viewpoints[0].position for move in moves]
    assert [(p.x, p.z) for p in places[:6]] == [(4, 0), (6, 0), (8, 0), (10, 0), (10, 2), (10, 4)]
    assert {p.y for p in places} == {rings.EYES}


async def test_the_opening_states_rings_and_formats(viewpoint):
    [opening] = await taken(viewpoint(0.0).requests("s-1"), 1)
    full, part, root = opening.open.interest.rings
    assert not full.HasField("format") and full.radius == 3.4
    assert part.format.fps == 20 and len(part.format.bones) == 13
    assert root.format.encoding == motion_pb2.POSE_ENCODING_ROOT and root.radius == MAX_RADIUS
    assert len(opening.open.interest.viewpoints) == 1


async def test_a_viewpoint_that_stands_is_said_once(viewpoint):
    requests = viewpoint(0.0).requests("s-1")
    await anext(requests)
    with pytest.raises(StopAsyncIteration):
        await asyncio.wait_for(anext(requests), 5)
