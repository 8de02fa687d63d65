import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfarer.errors import FailedPrecondition, InvalidArgument, NotFound, Unreachable
from wayfarer.navigation.examples import (
    EXAMPLES,
    PLATFORM,
    corridor,
    corridor_doors,
    cubes_field,
    rectangle,
    slope_with_steps,
    two_storeys,
)
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import Box, Cylinder, Floor, SceneSpec, Walkable
from wayfarer.navigation.solids import footprint

FAR_APART = {
    "cubes_field": ((1.0, 1.0), (19.0, 19.0)),
    "town_square": ((-18.0, 18.0), (18.0, -18.0)),
    "corridor": ((3.0, 3.5), (21.0, -3.5)),
    "slope_with_steps": ((10.0, 1.0), (10.0, 19.0)),
    "two_storeys": ((1.0, 7.0), (11.0, 7.0)),
}
"""A start and a goal in each, with a way through most of it."""

FIELD = bake(cubes_field(4, boxes=10, side=10.0))
CORRIDOR = bake(corridor())
boxes = st.builds(
    Box,
    center=st.tuples(st.floats(-1, 11), st.floats(-1, 11)),
    size=st.tuples(st.floats(0.1, 4), st.floats(0.1, 4)),
    height=st.just(1.0),
    yaw=st.floats(0, 3.2),
)


def free_area(scene: Scene) -> shapely.Geometry:
    # On a grid: without one, GEOS loses whole polygons beside slivers (15 m² of 60, once).
    return shapely.union_all(shapely.polygons(scene.mesh.corners), grid_size=1e-7)


def test_examples_bake_to_one_island_with_a_way_across() -> None:
    for name, make in EXAMPLES.items():
        scene = bake(make())
        assert scene.islands == 1, name
        path = scene.path(*FAR_APART[name])
        assert path.goal_moved == 0 and scene.is_clear(path.points), name


@settings(max_examples=25, deadline=None)
@given(st.lists(boxes, min_size=1, max_size=4), st.data())
def test_repairs_equal_a_bake_from_scratch(placed: list[Box], data: st.DataObject) -> None:
    """Put, move and remove in any order: the ground is that of the present obstacles."""
    scene, standing = FIELD, dict[str, Box]()
    for number, box in enumerate(placed):
        name = data.draw(st.sampled_from(["a", "b", "c"]), label=f"name {number}")
        scene = scene.put(name, box)
        standing[name] = box
    if data.draw(st.booleans()):
        name = data.draw(st.sampled_from(sorted(standing)))
        scene = scene.remove(name)
        del standing[name]
    solids = (*FIELD.spec.solids, *standing.values())
    anew = bake(replace(FIELD.spec, solids=solids, entries=((0.0, 0.0, 0.0),)))
    mine, theirs = free_area(scene), free_area(anew)
    # the bake from scratch drops islands without an entry; a repair keeps all
    assert theirs.difference(mine.buffer(0.01)).area < 1e-3
    blocked = shapely.union_all([footprint(box) for box in standing.values()])
    assert mine.intersection(blocked.buffer(FIELD.spec.walkable.radius)).area < 1e-3
    assert mine.difference(free_area(FIELD).buffer(1e-3)).area < 1e-6
    lost = free_area(FIELD).difference(blocked.buffer(FIELD.spec.walkable.radius * 1.03))
    assert lost.difference(mine.buffer(1e-2)).area < 1e-3
    assert scene.area == pytest.approx(mine.area, abs=1e-3)


def test_ground_beside_corners_that_coincide_is_not_lost() -> None:
    """A box that got shorter, found by the test above: half a square metre along a wall was gone,
    since of two corners in one place both were taken for points of a straight line.
    """
    short = Box((0.0, 0.0), (0.5, 2.0), 1.0, 2.25)
    scene = FIELD.put("a", Box((0.0, 0.0), (0.5, 3.0), 1.0, 2.25)).put("a", short)
    assert scene.area == pytest.approx(FIELD.put("a", short).area, abs=1e-3)


def test_what_was_put_and_removed_leaves_no_trace() -> None:
    scene = FIELD
    for k in range(20):
        scene = scene.put("crate", Cylinder((1.0 + 0.4 * k, 5.0), 0.4, 1.0))
    scene = scene.remove("crate")
    assert scene.version == 21
    assert scene.area == pytest.approx(FIELD.area, abs=1e-3)
    assert len(scene.mesh.corners) < 1.2 * len(FIELD.mesh.corners)
    spots = np.random.default_rng(0).uniform(0, 10, (500, 2))
    np.testing.assert_allclose(scene.distance(spots), FIELD.distance(spots), atol=0.03)


def test_a_version_never_changes() -> None:
    scene = bake(cubes_field(4, boxes=10, side=10.0))
    before = scene.path((0.5, 0.5), (9.5, 9.5)).points
    area = scene.area
    later = scene.put("wall", Box((5.0, 5.0), (7.0, 0.2), 2.0))
    assert (scene.area, scene.version, dict(scene.obstacles)) == (area, 0, {})
    np.testing.assert_array_equal(scene.path((0.5, 0.5), (9.5, 9.5)).points, before)
    assert later.area < area and later.version == 1
    assert scene.is_clear(before) and not later.is_clear(before)
    assert later.is_clear(later.path((0.5, 0.5), (9.5, 9.5)).points)
    with pytest.raises(TypeError):
        scene.obstacles["x"] = Box((0.0, 0.0), (1.0, 1.0), 1.0)  # type: ignore[index]


def test_a_closed_door_makes_a_room_unreachable_until_it_opens() -> None:
    name, door = next(iter(corridor_doors().items()))
    room = (door.center[0], door.center[1] - 2.0)
    hall = (20.0, 0.0)
    closed = CORRIDOR.put(name, door)
    assert closed.islands == 2
    with pytest.raises(Unreachable) as caught:
        closed.path(hall, room)
    x, y, _ = caught.value.nearest
    assert closed.path(hall, (x, y)).goal_moved < 1e-6
    assert abs(x - room[0]) < 0.6 and abs(y - door.center[1]) < 0.6
    assert closed.remove(name).path(hall, room).goal == (*room, 0.0)
    inside = closed.path((room[0] - 1.0, room[1]), room)
    assert inside.length == pytest.approx(1.0)


def test_goals_off_the_ground_are_moved_and_the_reply_says_so() -> None:
    path = FIELD.path((0.5, 0.5), (30.0, 5.0))
    assert path.goal[0] == pytest.approx(9.7, abs=0.02) and path.goal_moved > 20
    box = FIELD.spec.solids[0]
    path = FIELD.path((0.5, 0.5), box.center)
    assert 0 < path.goal_moved < 3 and path.start_moved == 0
    assert FIELD.nearest((0.5, 0.5)) == (0.5, 0.5, 0.0)


@pytest.mark.parametrize("goal", [(float("nan"), 0.0), (1e9, 0.0), (1.0,)])
def test_malformed_points_name_their_field(goal: tuple[float, ...]) -> None:
    with pytest.raises(InvalidArgument, match="goal"):
        FIELD.path((0.5, 0.5), goal)  # type: ignore[arg-type]


def test_unknown_obstacles_and_malformed_ones_are_refused() -> None:
    with pytest.raises(NotFound, match="'ghost'"):
        FIELD.remove("ghost")
    with pytest.raises(InvalidArgument, match=r"obstacle\.size"):
        FIELD.put("flat", Box((1.0, 1.0), (0.0, 1.0), 1.0))


def test_an_obstacle_over_everything_is_refused() -> None:
    with pytest.raises(FailedPrecondition, match="no free ground"):
        FIELD.put("roof", Box((5.0, 5.0), (30.0, 30.0), 1.0))


def test_ground_too_narrow_for_the_radius_is_refused() -> None:
    with pytest.raises(InvalidArgument, match="radius"):
        bake(SceneSpec((Floor(rectangle(0, 0, 0.5, 10)),)))


def test_islands_are_kept_by_size_or_by_entry() -> None:
    floors = tuple(Floor(rectangle(*r)) for r in ((0, 0, 10, 10), (12, 0, 16, 4), (18, 0, 19, 1)))
    assert bake(SceneSpec(floors)).islands == 2
    only = bake(SceneSpec(floors, entries=((18.5, 0.5, 0.0),)))
    assert only.islands == 1 and only.area < 1


def test_obstacles_below_a_step_or_above_a_head_block_nothing() -> None:
    low, high = Box((5.0, 5.0), (2.0, 2.0), 0.2), Box((5.0, 5.0), (2.0, 2.0), 1.0, bottom=2.5)
    scene = FIELD.put("low", low).put("high", high)
    assert scene.area == FIELD.area and scene.version == 2


def test_the_slope_and_steps_carry_a_path_over_the_platform() -> None:
    scene = bake(slope_with_steps())
    path = scene.path((10.0, 1.0), (10.0, 19.0))
    assert path.length == pytest.approx(18.0, abs=0.1)
    ways = np.linspace(0, path.length, 60)
    places = np.stack(
        [np.interp(ways, path.along, np.array(path.points)[:, i]) for i in (0, 1)], -1
    )
    heights = scene.floor(places)
    assert heights.max() == pytest.approx(PLATFORM, abs=0.01) and heights[0] == heights[-1] == 0
    around = scene.path((8.0, 11.0), (6.0, 11.0))  # no way down the platform's west edge
    assert around.start_moved == around.goal_moved == 0 and around.length > 7


def test_storeys_are_told_apart_by_height() -> None:
    scene = bake(two_storeys())
    under, over = scene.path((1.0, 7.0), (11.0, 7.0, 0.0)), scene.path((1.0, 7.0), (11.0, 7.0, 3.0))
    assert under.length == pytest.approx(10.0) and under.goal[2] == 0
    assert over.length > 15 and over.goal[2] == pytest.approx(3.0)
    assert scene.is_clear(under.points) and scene.is_clear(over.points)
    points = np.array([[9.0, 6.0, 0.1], [9.0, 6.0, 2.9]])
    np.testing.assert_allclose(scene.floor(points), [0.0, 3.0])
    np.testing.assert_allclose(scene.distance(points), [2.0, 2.0], atol=0.1)
    above = scene.put("crate", Box((9.0, 6.0), (1.0, 1.0), 1.0, bottom=3.0))
    np.testing.assert_allclose(above.distance(points)[0], 2.0, atol=0.1)
    assert above.distance(points)[1] < 0
    back = scene.path((11.0, 7.0, 3.0), (1.0, 7.0))
    assert back.length == pytest.approx(over.length, rel=1e-6)


TABLE = Box((9.0, 4.0), (1.2, 0.8), 0.75)
"""A point on the lower floor, right under the gallery."""


@pytest.mark.parametrize(
    ("z", "ground"),
    [
        (-0.5, 0.0),
        (0.0, 0.0),
        (0.9, 0.0),
        (2.0, 0.0),
        (2.8, 3.0),
        (3.0, 3.0),
        (3.9, 3.0),
        (9.0, 3.0),
    ],
)
def test_a_height_means_the_ground_below_it(z: float, ground: float) -> None:
    """Heights of hips, heads, roots of other characters; a point just in the floor is on it."""
    assert bake(two_storeys()).nearest((9.0, 6.0, z)) == pytest.approx((9.0, 6.0, ground))


@pytest.mark.parametrize("z", [0.0, 0.75, 1.5])
def test_a_click_on_a_table_sends_nobody_upstairs(z: float) -> None:
    spec = two_storeys()
    scene = bake(replace(spec, solids=(*spec.solids, TABLE)))
    start, clicked = (7.0, 1.0, 0.0), (9.0, 4.0, z)
    for x, y, ground in (scene.nearest(clicked), scene.path(start, clicked).goal):
        assert ground == 0 and 0.5 < math.dist((x, y), clicked[:2]) < 1.0
    assert scene.nearest((9.0, 4.0, 3.0)) == pytest.approx((9.0, 4.0, 3.0))


def test_ground_far_above_a_point_is_taken_when_there_is_none_below() -> None:
    scene = bake(SceneSpec((Floor(rectangle(0.0, 0.0, 5.0, 5.0), height=40.0),)))
    assert scene.nearest((2.0, 2.0, 0.0)) == pytest.approx((2.0, 2.0, 40.0))


def test_a_wider_agent_has_less_room() -> None:
    spec = cubes_field(2)
    areas = [bake(replace(spec, walkable=Walkable(radius=r))).area for r in (0.2, 0.3, 0.5)]
    assert areas[0] > areas[1] > areas[2]


def test_an_equal_obstacle_changes_nothing() -> None:
    once = FIELD.put("crate", Cylinder((5.0, 5.0), 0.4, 1.0))
    assert once.put("crate", Cylinder((5.0, 5.0), 0.4, 1.0)) is once
    assert once.put("crate", Cylinder((5.0, 5.0), 0.5, 1.0)).version == 2
    assert once.put("other", Cylinder((5.0, 5.0), 0.4, 1.0)).version == 2
