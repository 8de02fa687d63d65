"""Walkable ground: flat scenes exactly, all others within a cell."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
import trimesh

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.examples import cubes_field, rectangle
from wayfarer.navigation.ground import ground, layers, raster
from wayfarer.navigation.ground.ground import find_ground
from wayfarer.navigation.scene_spec import (
    Y_UP,
    Z_UP,
    Box,
    Cylinder,
    Floor,
    MeshFile,
    Prism,
    Ramp,
    SceneSpec,
    Solid,
    Walkable,
)
from wayfarer.navigation.solids import footprint

FLOOR = Floor(rectangle(0, 0, 10, 10))


def area(*solids: Solid, **walkable: float) -> float:
    spec = SceneSpec((FLOOR,), solids, walkable=Walkable(**walkable))
    return sum(layer.own.area for layer in find_ground(spec).layers)


def as_mesh(spec: SceneSpec, subdivide: int = 0) -> SceneSpec:
    """The scene's floor and boxes as one mesh of closed boxes."""
    x0, y0, x1, y1 = shapely.Polygon(spec.floors[0].outline).bounds
    floor = trimesh.creation.box((x1 - x0, y1 - y0, 0.2))
    floor.apply_translation(((x0 + x1) / 2, (y0 + y1) / 2, -0.1))
    parts = [floor]
    for box in spec.solids:
        assert isinstance(box, Box)
        part = trimesh.creation.box((*box.size, box.height))
        part.apply_transform(trimesh.transformations.rotation_matrix(box.yaw, (0, 0, 1)))
        part.apply_translation((*box.center, box.bottom + box.height / 2))
        parts.append(part)
    mesh = trimesh.util.concatenate(parts)
    for _ in range(subdivide):
        mesh = mesh.subdivide()
    data = mesh.export(file_type="ply")
    return replace(spec, floors=(), solids=(), mesh=MeshFile(data, "ply", axes=Z_UP))


def test_a_flat_scene_keeps_its_exact_outlines() -> None:
    box, post = Box((3.0, 3.0), (2.0, 1.0), 1.0, 0.4), Cylinder((7.0, 7.0), 1.0, 2.0)
    wall = Prism(((0.0, 8.0), (4.0, 8.0), (0.0, 9.0)), 2.0)
    ground = find_ground(SceneSpec((FLOOR,), (box, post, wall)))
    assert ground.cell == 0 and len(ground.layers) == 1
    assert ground.layers[0].own.area == pytest.approx(100 - 2 - footprint(post).area - 2)
    assert np.pi <= footprint(post).area < 1.01 * np.pi


def test_what_hangs_higher_than_a_body_is_walked_under() -> None:
    assert area(Box((5.0, 5.0), (2.0, 2.0), 1.0, bottom=2.0)) == pytest.approx(100)
    assert area(Box((5.0, 5.0), (2.0, 2.0), 1.0, bottom=1.5)) == pytest.approx(96)


def test_a_mesh_gives_the_same_ground_within_a_cell() -> None:
    spec = cubes_field(3, boxes=12)
    exact = find_ground(spec).layers[0].own
    sampled = find_ground(as_mesh(spec))
    assert len(sampled.layers) == 1
    ground = sampled.layers[0].own
    assert ground.difference(exact.buffer(1.5 * sampled.cell)).area < 1e-6
    assert exact.buffer(-1.5 * sampled.cell).difference(ground).area < 1e-6


def test_subdividing_changes_nothing() -> None:
    spec = cubes_field(3, boxes=6)
    coarse, fine = (find_ground(as_mesh(spec, k)).layers[0].own for k in (0, 3))
    assert coarse.symmetric_difference(fine).area < 0.05


@pytest.mark.parametrize(("height", "reached"), [(0.2, True), (0.3, False)])
def test_a_step_no_higher_than_step_height_is_walked_onto(height: float, reached: bool) -> None:
    inside = area(Box((5.0, 5.0), (4.0, 4.0), height), step_height=0.25)
    assert inside == pytest.approx(100 if reached else 84, abs=3)


@pytest.mark.parametrize(("degrees", "reached"), [(30.0, True), (50.0, False)])
def test_slopes_up_to_the_limit_are_ground(degrees: float, reached: bool) -> None:
    rise = 3.0 * np.tan(np.radians(degrees))
    ramp = Ramp((5.0, 5.0), (4.0, 3.0), float(rise))
    spec = SceneSpec((FLOOR,), (ramp,), walkable=Walkable(slope_deg=40.0))
    layer = find_ground(spec).layers[0]
    assert layer.own.contains(shapely.Point(5.0, 5.0)) == reached
    if reached:
        heights = layer.heights.at(np.array([[5.0, 4.0], [5.0, 5.0], [5.0, 6.0], [1.0, 1.0]]))
        expected = [rise / 6, rise / 2, rise * 5 / 6, 0.0]
        np.testing.assert_allclose(heights, expected, atol=0.02)


def test_stairs_reach_a_platform_whose_edge_is_a_drop() -> None:
    stairs = [Box((2.0 + 0.3 * k, 5.0), (0.3, 2.0), 0.2 * (k + 1)) for k in range(5)]
    platform = Box((6.0, 5.0), (5.0, 4.0), 1.0)
    layer = find_ground(SceneSpec((FLOOR,), (*stairs, platform))).layers[0]
    assert layer.own.contains(shapely.Point(6.0, 5.0))
    drop = shapely.LineString([(8.0, 5.0), (9.5, 5.0)])
    assert not layer.own.covers(drop)
    np.testing.assert_allclose(layer.heights.at(np.array([[2.6, 5.0], [6.0, 5.0]])), [0.6, 1.0])


def test_the_inside_of_a_hollow_tall_box_is_left_out_and_an_entry_keeps_it() -> None:
    spec = as_mesh(SceneSpec((FLOOR,), (Box((5.0, 5.0), (2.0, 2.0), 3.0),)))
    assert not find_ground(spec).layers[0].own.contains(shapely.Point(5, 5))
    inside = find_ground(replace(spec, entries=((5.0, 5.0, 0.0),)))
    assert [round(layer.own.area) for layer in inside.layers] == [4]


def test_storeys_above_each_other_become_layers() -> None:
    spec = SceneSpec((FLOOR, Floor(rectangle(2, 2, 8, 8), height=3.0)))
    ground = find_ground(spec)
    assert [round(layer.own.area) for layer in ground.layers] == [100, 36]
    spot = np.array([5.0, 5.0])
    assert [float(layer.heights.at(spot)) for layer in ground.layers] == [0.0, 3.0]


def test_meshes_with_flipped_or_missing_faces_still_have_ground() -> None:
    spec = as_mesh(SceneSpec((FLOOR,), (Box((5.0, 5.0), (2.0, 2.0), 1.0),)))
    assert spec.mesh is not None
    mesh = trimesh.load_mesh(trimesh.util.wrap_as_stream(spec.mesh.data), file_type="ply")
    mesh.faces[::2] = mesh.faces[::2, ::-1]
    mesh.update_faces(np.arange(len(mesh.faces)) != 5)
    data = mesh.export(file_type="ply")
    torn = find_ground(replace(spec, mesh=MeshFile(data, "ply", axes=Z_UP)))
    assert torn.layers[0].own.area == pytest.approx(find_ground(spec).layers[0].own.area, abs=0.5)


def test_a_scene_on_its_side_says_so() -> None:
    flat = as_mesh(SceneSpec((FLOOR,)))
    assert flat.mesh is not None
    walls = replace(flat, mesh=replace(flat.mesh, axes=Y_UP))
    # the floor stands upright now: its edge, 20 cm wide, is all that is level
    assert find_ground(walls).layers[0].own.area < 2.5
    triangle = b"v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n"
    with pytest.raises(InvalidArgument, match="up axis"):
        find_ground(SceneSpec(mesh=MeshFile(triangle, "obj", axes=Z_UP)))


def test_scenes_larger_than_the_limit_are_refused() -> None:
    with pytest.raises(InvalidArgument, match="at most 500 m"):
        find_ground(SceneSpec((Floor(rectangle(0, 0, 501, 1)),)))


def test_too_many_surfaces_above_each_other_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(raster, "MAX_SAMPLES", 100_000)
    floors = tuple(Floor(rectangle(0, 0, 10, 10), height=2.0 * k) for k in range(5))
    with pytest.raises(InvalidArgument, match="above each other"):
        find_ground(SceneSpec(floors))


def strips(count: int) -> SceneSpec:
    """Thin walls that cross each other: the holes grow with the square of their number."""
    places = [(k + 0.5) * 10 / count for k in range(count)]
    upright = [Box((x, 5.0), (0.12, 9.8), 2.0) for x in places]
    level = [Box((5.0, y), (9.8, 0.12), 2.0) for y in places]
    return SceneSpec((FLOOR,), (*upright, *level))


def test_too_many_crossings_go_through_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    exact = find_ground(strips(6))
    monkeypatch.setattr(ground, "MAX_EXACT_CORNERS", 50)
    sampled = find_ground(strips(6))
    assert exact.cell == 0 and sampled.cell > 0
    assert sampled.layers[0].own.area == pytest.approx(exact.layers[0].own.area, rel=0.12)
    monkeypatch.setattr(layers, "MAX_PIECES", 20)
    with pytest.raises(InvalidArgument, match="pieces and holes, at most 20"):
        find_ground(strips(6))


def test_outlines_of_too_many_corners_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ground, "MAX_CORNERS", 100)
    with pytest.raises(InvalidArgument, match="corners, at most 100"):
        find_ground(strips(6))
