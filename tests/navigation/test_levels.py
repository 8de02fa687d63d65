"""Properties of others' levels: domes, strays, roofs, low lintels, narrow doors, wrong axes.

Each is read correctly or reported. Places and lengths are in the world (metres, Z up).
"""

import re
from collections.abc import Sequence

import numpy as np
import pytest
import trimesh

from tests.navigation.meshes.glb_files import LEVELS
from wayfarer.errors import InvalidArgument, Unreachable
from wayfarer.navigation.examples import EXAMPLES, rectangle, two_storeys
from wayfarer.navigation.meshes.outliers import parts
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import (
    Y_UP,
    Z_UP,
    Box,
    Floor,
    MeshAxes,
    MeshFile,
    Point3,
    SceneSpec,
    Walkable,
)

X_UP: MeshAxes = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))


def box(low: Sequence[float], high: Sequence[float]) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=np.array([low, high], float))


def yard() -> list[trimesh.Trimesh]:
    """20 m x 20 m with walls of 2 m around it and one across, which leaves a gap."""
    walls = [((-10, -10), (10, -9.8)), ((-10, 9.8), (10, 10)), ((-10, -10), (-9.8, 10))]
    walls += [((9.8, -10), (10, 10)), ((-10, -0.1), (6, 0.1))]
    return [box((-10, -10, -0.2), (10, 10, 0)), *(box((*a, 0), (*b, 2)) for a, b in walls)]


def level(*pieces: trimesh.Trimesh, entries: tuple[Point3, ...] = (), **mesh: object) -> SceneSpec:
    data = trimesh.util.concatenate(list(pieces)).export(file_type="obj").encode()
    return SceneSpec(mesh=MeshFile(data, "obj", **{"axes": Z_UP, **mesh}), entries=entries)  # type: ignore[arg-type]


def case(name: str, **mesh: object) -> SceneSpec:
    """A file as it comes over HTTP without further parameters."""
    form = name.rpartition(".")[2]
    data = (LEVELS / name).read_bytes()
    return SceneSpec(mesh=MeshFile(data, form, **{"axes": Y_UP, **mesh}))  # type: ignore[arg-type]


def notes(scene: Scene) -> str:
    return "\n".join(map(str, scene.notes))


AREA = bake(level(*yard())).area


# Domes, and distant strays


def sky(radius: float, sink: float = 0.1) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=3, radius=radius).apply_translation(
        (0, 0, -sink)
    )


def test_the_case_of_a_dome_is_the_yard_below_it() -> None:
    scene = bake(case("sky_dome.glb"))
    assert scene.bounds == pytest.approx((-10, -10, 10, 10), abs=0.1) and scene.ground.cell == 0.05
    assert (
        "96 triangles, 1800 m x 1800 m, that lie over all else (20 m x 20 m) like a sky"
        in notes(scene)
    )


@pytest.mark.parametrize("radius", [30.0, 200.0, 900.0, 30_000.0])
def test_a_sphere_of_any_size_around_a_level_is_left_out(radius: float) -> None:
    scene = bake(level(*yard(), sky(radius)))
    assert scene.area == pytest.approx(AREA) and "1,280 triangles" in notes(scene)


def test_a_skybox_and_clouds_inside_of_it_are_left_out_one_after_the_other() -> None:
    sides = box((-600, -600, -600), (600, 600, 600))
    clouds = trimesh.creation.icosphere(subdivisions=2, radius=150)
    scene = bake(level(*yard(), sides, clouds))
    assert scene.area == pytest.approx(AREA) and notes(scene).count("like a sky") == 2


def test_a_hall_with_a_roof_on_its_walls_and_a_valley_below_a_castle_stay() -> None:
    roof = box((-10, -10, 2), (10, 10, 2.2))
    scene = bake(level(*yard(), roof))
    assert "left out" not in notes(scene) and scene.islands == 2
    valley, castle = box((-18, -18, -30), (18, 18, -20)), yard()
    assert "left out" not in notes(bake(level(valley, *castle)))


def stray(x: float, y: float = 0.0, z: float = 0.0) -> trimesh.Trimesh:
    return trimesh.Trimesh([(x, y, z), (x + 1, y, z), (x, y + 1, z)], [(0, 1, 2)])


@pytest.mark.parametrize("places", [[400.0], [3_000.0], [-25_000.0], [400.0, -400.0]])
def test_what_strays_far_away_is_left_out_and_named(places: list[float]) -> None:
    scene = bake(level(*yard(), *map(stray, places)))
    assert scene.area == pytest.approx(AREA) and scene.ground.cell == 0.05
    many = "1 triangle" if len(places) == 1 else "2 triangles"
    assert f"left out: {many}" in notes(scene) and "far from all else" in notes(scene)


def test_a_stray_place_with_an_entry_stays() -> None:
    far = box((200, 0, -1), (203, 3, 0))
    scene = bake(level(*yard(), far, entries=((201.0, 1.0, 0.0), (0.0, 5.0, 0.0))))
    assert scene.islands == 2 and "left out" not in notes(scene)


def test_two_places_of_a_size_both_stay() -> None:
    other = [piece.copy().apply_translation((300, 0, 0)) for piece in yard()]
    scene = bake(level(*yard(), *other))
    assert scene.islands == 2 and "left out" not in notes(scene)


def test_a_level_that_is_too_large_as_a_whole_is_refused() -> None:
    with pytest.raises(InvalidArgument, match=r"is mesh\.unit right"):
        bake(level(*yard(), unit=100.0))
    with pytest.raises(InvalidArgument, match=r"beyond 10000 m: is mesh\.unit \(1000 m\) right"):
        bake(level(*(p.copy().apply_scale(2) for p in yard()), unit=1000.0))


def test_parts_hold_together_what_touches_however_large_its_triangles_are() -> None:
    long = np.array(
        [[[0, 0, 0], [400, 0, 0], [400, 0.01, 0]], [[400, 0, 0], [400, 400, 0], [399, 0, 0]]]
    )
    assert len(set(parts(long.astype(float)))) == 1
    apart = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[20, 0, 0], [21, 0, 0], [20, 1, 0]]])
    assert len(set(parts(apart.astype(float)))) == 2


# A wrong axis, a wrong unit


@pytest.mark.parametrize(
    ("spec", "text"),
    [
        (case("yard_z_up.obj"), "along the file's Z axis.*send mesh.basis blender"),
        (level(*yard(), axes=Y_UP), "along the file's Z axis.*send mesh.basis blender"),
        (level(*yard(), axes=X_UP), "along the file's Z axis.*send mesh.basis blender"),
    ],
)
def test_a_level_on_its_side_is_told(spec: SceneSpec, text: str) -> None:
    told = notes(bake(spec))
    assert "seems to lie on its side" in told and re.search(text, told)


def test_a_file_with_y_up_that_is_taken_for_z_up_is_told_its_basis() -> None:
    turned = [
        p.copy().apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
        for p in yard()
    ]
    assert "if the file is Y up, send mesh.basis gltf" in notes(bake(level(*turned)))


@pytest.mark.parametrize("name", EXAMPLES)
def test_levels_that_stand_are_not_told_to_lie(name: str) -> None:
    assert bake(EXAMPLES[name]()).notes == ()


def test_a_maze_of_high_walls_stands() -> None:
    walls = [box((x, -9, 0), (x + 0.2, 9, 3)) for x in range(-9, 10, 2)]
    walls += [box((-9, y, 0), (9, y + 0.2, 3)) for y in (-9, 0, 9)]
    assert "side" not in notes(bake(level(*yard(), *walls)))


@pytest.mark.parametrize(
    ("spec", "size"),
    [
        (case("room_in_20_cm.obj"), "the level is 0.2 m x 0.2 m and 0.01 m high"),
        (level(*yard(), unit=0.001), "the level is 0.02 m x 0.02 m and 0.0022 m high"),
        (case("closed_room.obj", unit=0.01), r"the level is 0.1 m x 0.1 m and 0.034 m high"),
    ],
)
def test_a_level_that_is_too_small_is_told_its_size_and_the_unit(
    spec: SceneSpec, size: str
) -> None:
    with pytest.raises(InvalidArgument, match=rf"{size} \(is mesh\.unit, .* m, right\?\)"):
        bake(spec)


# Roofs


def test_nobody_comes_to_a_roof_and_the_answer_asks_for_an_entry() -> None:
    scene = bake(case("closed_room.obj"))
    assert scene.islands == 2
    middle = scene.mesh.corners[scene.mesh.island == scene.main_island].mean((0, 1))
    assert scene.floor(np.array([*middle, 0.0])) == pytest.approx(0.0, abs=0.05)
    assert "ground lies above ground: 1 of 2 islands" in notes(scene)
    assert "name an entry" in notes(scene)


def test_with_an_entry_only_what_is_reached_from_there_is_kept_and_nothing_is_told() -> None:
    spec = case("closed_room.obj")
    scene = bake(SceneSpec(mesh=spec.mesh, entries=((0.0, 0.0, 0.0),)))
    assert scene.islands == 1 and scene.notes == ()


def test_a_tower_of_three_slabs_has_two_roofs() -> None:
    slabs = [box((-5, -5, z - 0.2), (5, 5, z)) for z in (0, 3, 6)]
    scene = bake(level(*slabs))
    assert "2 of 3 islands" in notes(scene)
    assert scene.main_island == scene.island_of([(0.0, 0.0, 0.0)])
    heights = [np.unique(layer.heights.values.round(3)).tolist() for layer in scene.ground.layers]
    assert heights == [[0.0], [3.0], [6.0]]  # and nothing of the slabs' undersides


def test_an_upper_storey_with_stairs_is_no_roof_and_a_cellar_makes_none_of_a_field() -> None:
    assert bake(two_storeys()).notes == ()
    field, cellar = box((-20, -20, -0.2), (20, 20, 0)), box((-6, -6, -3.2), (6, 6, -3))
    scene = bake(level(field, cellar))
    assert (
        scene.islands == 2 and scene.notes == () and scene.mesh.areas.argmax() == scene.main_island
    )


# Barriers


def refusal(scene: Scene, start: Point3, goal: Point3) -> str:
    with pytest.raises(Unreachable) as caught:
        scene.path(start, goal)
    return str(caught.value.explained())


def test_the_case_of_low_stairs_is_told_in_the_answer_and_in_the_refusal() -> None:
    scene = bake(case("stairs_under_1_85_m.obj"))
    low = "headroom of 1.85 m at"
    assert low in notes(scene) and "where 1.9 m are asked for (walkable.height)" in notes(scene)
    assert low in refusal(scene, (0.0, -2.0, 0.0), (0.0, 4.0, 1.44))
    high = bake(SceneSpec(mesh=scene.spec.mesh, walkable=Walkable(height=1.8)))
    assert high.notes == () and high.path((0.0, -2.0, 0.0), (0.0, 4.0, 1.44)).goal_moved == 0


def gate(lintel: float) -> list[trimesh.Trimesh]:
    """A wall across the yard with one door below a lintel."""
    return [
        box((-10, -0.1, 0), (-1, 0.1, 3)),
        box((1, -0.1, 0), (10, 0.1, 3)),
        box((-1, -0.1, lintel), (1, 0.1, 3)),
    ]


def floor_and(*pieces: trimesh.Trimesh) -> SceneSpec:
    return level(box((-10, -10, -0.2), (10, 10, 0)), *pieces)


def test_a_low_lintel_is_told_and_with_two_in_a_row_the_lower_one() -> None:
    assert "headroom of 1.7 m at (0" in refusal(bake(floor_and(*gate(1.7))), (0, -5, 0), (0, 5, 0))
    second = [piece.copy().apply_translation((0, 5, 0)) for piece in gate(1.5)]
    scene = bake(floor_and(*gate(1.7), *second))
    assert "headroom of 1.5 m" in refusal(scene, (0.0, -5.0, 0.0), (0.0, 8.0, 0.0))
    assert "headroom of 1.7 m" in refusal(scene, (0.0, -5.0, 0.0), (0.0, 3.0, 0.0))


def test_a_beam_over_a_flat_scene_is_told() -> None:
    floor = Floor(rectangle(0, 0, 6, 12))
    scene = bake(SceneSpec((floor,), (Box((3.0, 6.0), (6.0, 0.4), 0.5, bottom=1.6),)))
    assert scene.ground.cell == 0
    assert "headroom of 1.6 m" in refusal(scene, (3.0, 2.0, 0.0), (3.0, 10.0, 0.0))


def test_a_wall_without_a_door_and_a_crawlway_are_told_as_no_headroom() -> None:
    for lintel in (0.0, 0.6):
        told = refusal(bake(floor_and(*gate(lintel))), (0.0, -5.0, 0.0), (0.0, 5.0, 0.0))
        assert told.startswith("no way leads to (0, 5, 0)") and "in the way" not in told


def test_tables_that_part_nothing_are_not_told() -> None:
    tables = [box((x, 2, 0.7), (x + 1, 3, 0.75)) for x in (-4, 0, 4)]
    assert bake(floor_and(*tables)).notes == ()


def narrow(width: float) -> tuple[Box, Box]:
    side = (6 - width) / 2
    return Box((side / 2, 6.0), (side, 0.3), 2.5), Box((6 - side / 2, 6.0), (side, 0.3), 2.5)


@pytest.mark.parametrize("width", [0.3, 0.5])
@pytest.mark.parametrize("is_mesh", [False, True])
def test_a_narrow_door_is_told_with_its_width(width: float, is_mesh: bool) -> None:
    spec = SceneSpec((Floor(rectangle(0, 0, 6, 12)),), narrow(width))
    if is_mesh:
        solid = [
            box((b.center[0] - b.size[0] / 2, 5.85, 0), (b.center[0] + b.size[0] / 2, 6.15, 2.5))
            for b in narrow(width)
        ]
        spec = level(box((0, 0, -0.2), (6, 12, 0)), *solid)
    told = refusal(bake(spec), (3.0, 2.0, 0.0), (3.0, 10.0, 0.0))
    assert "is in the way, where 0.6 m are asked for (twice walkable.radius)" in told
    found = float(told.partition("a passage about ")[2].split()[0])
    assert found == pytest.approx(width, abs=0.11 if is_mesh else 0.03)
    place = told.partition(" wide at (")[2].partition(")")[0].split(", ")
    assert float(place[0]) == pytest.approx(3, abs=0.3) and float(place[1]) == pytest.approx(
        6, abs=0.4
    )


def test_an_obstacle_that_leaves_a_narrow_gap_is_told_and_one_that_leaves_none_not() -> None:
    scene = bake(SceneSpec((Floor(rectangle(0, 0, 6, 12)),)))
    gap = scene.put("crate", Box((3.2, 6.0), (5.6, 0.5), 1.0))
    assert "a passage about 0.4 m wide at (0.2" in refusal(gap, (3.0, 2.0, 0.0), (3.0, 10.0, 0.0))
    shut = scene.put("crate", Box((3.0, 6.0), (7.0, 0.5), 1.0))
    assert "in the way" not in refusal(shut, (3.0, 2.0, 0.0), (3.0, 10.0, 0.0))


def test_an_obstacle_that_parts_the_ground_floor_keeps_people_off_the_roof() -> None:
    scene = bake(case("closed_room.obj"))
    inside = scene.place((0.0, 0.0, 0.0)).point
    parted = scene.put("wall", Box((0.0, 0.0), (12.0, 0.6), 2.0))
    middle = parted.mesh.corners[parted.mesh.island == parted.main_island].mean((0, 1))
    assert parted.islands == 3
    assert parted.floor(np.array([*middle, 0.0])) == pytest.approx(inside[2], abs=0.05)
    again = parted.remove("wall")
    assert again.main_island == again.island_of([inside]) and again.islands == 2


def court(*pieces: trimesh.Trimesh) -> Scene:
    return bake(level(box((-2, -5, -0.2), (2, 5, 0)), *pieces))


def platform(height: float) -> trimesh.Trimesh:
    return box((-2, 2, 0), (2, 5, height))


def ramp(degrees: float, height: float) -> trimesh.Trimesh:
    """A wedge up to the platform's edge."""
    foot = 2 - height / np.tan(np.radians(degrees))
    corners = [(x, *at) for x in (-1, 1) for at in ((foot, 0), (2, 0), (2, height))]
    return trimesh.convex.convex_hull(trimesh.PointCloud(corners).vertices)


def place_of(told: str, what: str) -> list[float]:
    return [float(part) for part in told.partition(f"{what} at (")[2].partition(")")[0].split(", ")]


def test_a_step_that_is_too_high_is_told_and_of_stairs_one_of_theirs() -> None:
    told = refusal(court(platform(0.6)), (0, -3, 0), (0, 4, 0.6))
    assert "is in the way, where 0.25 m are taken (walkable.step_height)" in told
    assert place_of(told, "a step of 0.6 m")[1] == pytest.approx(2, abs=0.1)
    stairs = [box((-1, 2 - 0.3 * k, 0), (1, 2, 1.6 - 0.4 * k)) for k in range(1, 4)]
    assert "a step of 0.4 m" in refusal(court(platform(1.6), *stairs), (0, -3, 0), (0, 4, 1.6))
    flat = bake(SceneSpec((Floor(rectangle(0, 0, 4, 9)),), (Box((2.0, 4.0), (4.0, 0.4), 0.5),)))
    assert flat.ground.cell == 0
    assert "a step of 0.5 m" in refusal(flat, (2.0, 2.0, 0.0), (2.0, 8.0, 0.0))


@pytest.mark.parametrize(("degrees", "height"), [(45, 2.5), (60, 2.5), (60, 0.8)])
def test_a_slope_that_is_too_steep_is_told(degrees: float, height: float) -> None:
    told = refusal(court(platform(height), ramp(degrees, height)), (0, -4, 0), (0, 4, height))
    assert "is in the way, where 40° are walked on (walkable.slope_deg)" in told
    x, y, z = place_of(told, f"a slope of {degrees}°")
    assert abs(x) < 1.1 and -1 < y < 2.1 and 0 <= z <= height


def test_a_stage_elsewhere_is_not_the_step_that_is_told_nor_a_wall() -> None:
    stage = box((-2, -5, 0), (2, -3, 0.8))
    assert "in the way" not in refusal(court(platform(3), stage), (0, 0, 0), (0, 4, 3))
    both = court(platform(0.8), stage)
    for goal, y in (((0.0, 4.0, 0.8), 2.0), ((0.0, -4.0, 0.8), -3.0)):
        told = refusal(both, (0.0, 0.0, 0.0), goal)
        assert place_of(told, "a step of 0.8 m")[1] == pytest.approx(y, abs=0.1)


def test_of_several_kinds_the_greatest_trouble_is_told() -> None:
    mixed = court(platform(2.5), ramp(50, 2.5), box((-2, -5, 0), (2, -3, 0.9)))
    assert "a step of 0.9 m" in refusal(mixed, (0, -4, 0.9), (0, 4, 2.5))
