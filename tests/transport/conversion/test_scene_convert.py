"""Scenes in every basis are the same scene."""

import math

import numpy as np
import pytest
import shapely

from wayfarer.errors import InvalidArgument
from wayfarer.navigation import scene_spec as world
from wayfarer.navigation.meshes.read import read_level
from wayfarer.navigation.paths.path import GroundPath
from wayfarer.navigation.solids import footprint
from wayfarer.transport import schema
from wayfarer.transport.conversion import scene_convert
from wayfarer.transport.conversion.basis import Basis
from wayfarer.world.scenes import messages as runtime

BASES = pytest.mark.parametrize("basis", Basis)


def vector(basis: Basis, x: float, y: float, z: float) -> dict[str, float]:
    """A point of the world, in a basis."""
    return dict(
        zip("xyz", basis.axes.points_to_wire(np.array([x, y, z], float)).tolist(), strict=True)
    )


def length(basis: Basis, metres: float) -> float:
    return metres / basis.axes.metres_per_unit


def extents(basis: Basis, right: float, forward: float, up: float) -> dict[str, float]:
    found = vector(basis, right, forward, up)
    return {axis: abs(value) for axis, value in found.items()}


def requested_scene(basis: Basis) -> schema.NewScene:
    """A yard with one of each, described in a basis."""
    at = [(0, 0), (20, 0), (20, 10), (0, 10)]
    hole = [(1, 1), (2, 1), (2, 2)]
    turn = basis.axes.handedness * 0.3
    return schema.NewScene.model_validate(
        {
            "basis": basis,
            "floors": [
                {
                    "outline": [vector(basis, x, y, 7) for x, y in at],
                    "holes": [{"points": [vector(basis, x, y, 7) for x, y in hole]}],
                    "height": length(basis, 0.5),
                }
            ],
            "solids": [
                {
                    "box": {
                        "position": vector(basis, 5, 6, 0.5),
                        "size": extents(basis, 2, 1, 3),
                        "heading": turn,
                    }
                },
                {
                    "cylinder": {
                        "position": vector(basis, 8, 2, 0.5),
                        "radius": length(basis, 0.4),
                        "height": length(basis, 2),
                    }
                },
                {
                    "prism": {
                        "outline": [vector(basis, x + 10, y, 0) for x, y in hole],
                        "bottom": length(basis, 0.5),
                        "height": length(basis, 1),
                    }
                },
                {
                    "ramp": {
                        "position": vector(basis, 15, 5, 0.5),
                        "size": extents(basis, 2, 4, 1),
                        "heading": turn,
                    }
                },
            ],
            "walkable": {"radius": length(basis, 0.4), "slope_deg": 30},
            "entries": [vector(basis, 1, 5, 0.5)],
        }
    )


@BASES
def test_a_scene_means_the_same_in_every_basis(basis):
    found = scene_convert.scene_spec(requested_scene(basis))
    (floor,), (box, cylinder, prism, ramp) = found.floors, found.solids
    square = shapely.Polygon([(0, 0), (20, 0), (20, 10), (0, 10)])
    assert shapely.Polygon(floor.outline).symmetric_difference(square).area < 1e-9
    assert np.allclose(floor.holes, [[(1, 1), (2, 1), (2, 2)]]) and floor.height == 0.5
    expected = (
        world.Box((5.0, 6.0), (2.0, 1.0), 3.0, 0.3, 0.5),
        world.Ramp((15.0, 5.0), (2.0, 4.0), 1.0, 0.3, 0.5),
    )
    for made, meant in zip((box, ramp), expected, strict=True):
        assert type(made) is type(meant)
        assert made.center == pytest.approx(meant.center)
        assert made.size == pytest.approx(meant.size)
        assert (made.height, made.yaw, made.bottom) == pytest.approx(
            (meant.height, meant.yaw, meant.bottom)
        )
    assert isinstance(cylinder, world.Cylinder) and isinstance(prism, world.Prism)
    assert cylinder.center == pytest.approx((8, 2))
    assert (cylinder.radius, cylinder.height, cylinder.bottom) == pytest.approx((0.4, 2, 0.5))
    assert np.allclose(prism.outline, [(11, 1), (12, 1), (12, 2)])
    assert (prism.height, prism.bottom) == pytest.approx((1, 0.5))
    assert found.walkable.radius == pytest.approx(0.4)
    assert (found.walkable.slope_deg, found.walkable.height) == (30, 1.9)
    assert np.allclose(found.entries, [(1, 5, 0.5)])


@BASES
@pytest.mark.parametrize("kind", ["box", "cylinder", "prism"])
def test_obstacles_come_back_as_they_were_put(basis, kind):
    solids = {s.given[0]: s.given[1] for s in requested_scene(basis).solids}
    given = schema.Obstacle(**{kind: solids[kind]})
    made = scene_convert.obstacle(given, basis.axes)
    info = runtime.SceneInfo("s", "", "", 1, 2.0, 1, (0, 0, 3, 4), {"crate": made}, 0, 0.0, 0.0)
    told = scene_convert.scene(info, basis, 60.0, None)
    (found,) = told.obstacles
    again = scene_convert.obstacle(found.obstacle, basis.axes)
    assert found.name == "crate" and found.obstacle.given[0] == kind
    assert footprint(again).symmetric_difference(footprint(made)).area < 1e-9
    assert (again.height, again.bottom) == pytest.approx((made.height, made.bottom))
    lengths = np.array([told.max.x - told.min.x, told.max.y - told.min.y, told.max.z - told.min.z])
    assert sorted(lengths * basis.axes.metres_per_unit) == pytest.approx([0, 3, 4])


@BASES
def test_a_mesh_of_a_basis_lies_where_goals_of_that_basis_do(basis):
    corners = [(0, 0, 0), (4, 0, 0), (4, 3, 1)]
    lines = ["v {x} {y} {z}".format(**vector(basis, *corner)) for corner in corners]
    data = "\n".join([*lines, "f 1 2 3"]).encode()
    obj = schema.Mesh(format="obj")
    found = read_level(scene_convert.mesh_file(obj, basis, data), world.Walkable(), ())[0]
    assert np.allclose(found, [corners])
    elsewhere = schema.Mesh(format="obj", basis=basis)
    again = read_level(scene_convert.mesh_file(elsewhere, Basis.ROS, data), world.Walkable(), ())[0]
    assert np.allclose(again, [corners])


def test_glb_is_in_gltfs_basis_and_units_can_be_said():
    glb = scene_convert.mesh_file(schema.Mesh(), Basis.UNREAL, b"")
    assert (glb.format, glb.axes, glb.unit) == ("glb", world.Y_UP, 1.0)
    inches = schema.Mesh(format="ply", unit=0.0254)
    assert scene_convert.mesh_file(inches, Basis.UNREAL, b"").unit == 0.0254
    assert scene_convert.mesh_file(schema.Mesh(format="ply"), Basis.UNREAL, b"").unit == 0.01


@BASES
def test_ways_and_outlines_are_told_in_the_basis(basis):
    axes = basis.axes
    way = GroundPath(np.array(((0.0, 0.0, 0.0), (3.0, 4.0, 1.0))), 0.0, 0.5, 3)
    told = scene_convert.scene_path(way, axes)
    assert told.points[1].model_dump() == pytest.approx(vector(basis, 3, 4, 1))
    assert (told.length, told.goal_moved) == pytest.approx((length(basis, 5), length(basis, 0.5)))
    ring = ((0.0, 0.0), (1.0, 0.0), (1.0, 2.0))
    block = runtime.Block(((0.0, 0.0, 2.0), (1.0, 0.0, 2.0), (1.0, 1.0, 2.0)), 0.5)
    drawn = scene_convert.outlines(
        runtime.Outlines(
            ((ring, ring),), ((3.0, 4.0, 1.0),), ((0, 1, 2),), (block,), {"a": block}, 2
        ),
        axes,
    )
    assert drawn.vertices == pytest.approx(tuple(vector(basis, 3, 4, 1).values()))
    assert drawn.walkable[0].holes[0].points[6:] == pytest.approx(
        tuple(vector(basis, 1, 2, 0).values())
    )
    assert drawn.solids[0].bottom == pytest.approx(length(basis, 0.5))
    assert drawn.obstacles[0].name == "a" and drawn.triangles == (0, 1, 2)


@pytest.mark.parametrize(
    ("field", "name"),
    [
        ("solids[0].size[1]", "solids[0].box.size"),
        ("solids[0].yaw", "solids[0].box.heading"),
        ("solids[0].bottom", "solids[0].box.position"),
        ("solids[1].center[0]", "solids[1].cylinder.position"),
        ("solids[1].height", "solids[1].cylinder.height"),
        ("solids[2].outline[7][1]", "solids[2].prism.outline[7]"),
        ("solids[3].height", "solids[3].ramp.size"),
        ("floors[0].outline[7][1]", "floors[0].outline[7]"),
        ("floors[0].holes[2]", "floors[0].holes[2].points"),
        ("entries[4][2]", "entries[4]"),
        ("walkable.radius", "walkable.radius"),
        ("mesh.data", "data"),
        ("", ""),
    ],
)
def test_errors_name_the_clients_fields(field, name):
    solids = requested_scene(Basis.GLTF).solids
    with pytest.raises(InvalidArgument) as caught, scene_convert.fields_named(solids):
        raise InvalidArgument(f"{field} is 3, allowed is 4", field)
    assert caught.value.field == name
    assert str(caught.value) == f"{name} is 3, allowed is 4"


def test_a_crowd_walks_at_the_sessions_speeds():
    asked = schema.Crowd(count=3, min_speed=50, max_speed=120, max_dwell=2)
    made = scene_convert.crowd(asked, Basis.UNREAL, 9)
    assert made == runtime.Crowd(3, 9, pytest.approx((0.5, 1.2)), (0.0, 2.0))
    assert math.isclose(made.speed[1], 1.2)
