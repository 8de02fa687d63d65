from dataclasses import replace
from math import cos, inf, nan, sin

import pytest

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.checks import check_obstacle, check_spec
from wayfarer.navigation.scene_spec import (
    MAX_MESH_BYTES,
    MAX_RING,
    MAX_SOLIDS,
    Box,
    Cylinder,
    Floor,
    MeshFile,
    Prism,
    Ramp,
    SceneSpec,
    Walkable,
)

SQUARE = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
BOW_TIE = ((0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (0.0, 4.0))
GOOD = SceneSpec((Floor(SQUARE),), (Box((1.0, 1.0), (1.0, 1.0), 1.0),))


def solid(value: object) -> SceneSpec:
    return replace(GOOD, solids=(GOOD.solids[0], value))  # type: ignore[arg-type]


def walkable(**values: float) -> SceneSpec:
    return replace(GOOD, walkable=Walkable(**values))


BAD = {
    "floors": SceneSpec(),
    "floors[0].outline": SceneSpec((Floor(BOW_TIE),)),
    "floors[0].outline[1][0]": SceneSpec((Floor(((0.0, 0.0), (nan, 0.0), (1.0, 1.0))),)),
    "floors[0].height": SceneSpec((Floor(SQUARE, height=inf),)),
    "floors[0].holes[0]": SceneSpec((Floor(SQUARE, (((3.0, 3.0), (9.0, 3.0), (3.0, 9.0)),)),)),
    "solids[1].size[1]": solid(Box((1.0, 1.0), (1.0, 0.0), 1.0)),
    "solids[1].size": solid(Box((1.0, 1.0), (1.0,), 1.0)),  # type: ignore[arg-type]
    "entries[1]": replace(GOOD, entries=((0.0, 0.0, 0.0), (1e9, 0.0, 0.0))),
    "solids[1].center": solid(Cylinder((1.0,), 1.0, 1.0)),  # type: ignore[arg-type]
    "solids[1].yaw": solid(Ramp((1.0, 1.0), (1.0, 1.0), 1.0, yaw=nan)),
    "solids[1].radius": solid(Cylinder((1.0, 1.0), -1.0, 1.0)),
    "solids[1].height": solid(Cylinder((1.0, 1.0), 1.0, nan)),
    "solids[1].bottom": solid(Cylinder((1.0, 1.0), 1.0, 1.0, inf)),
    "solids[1].outline": solid(Prism(((0.0, 0.0), (1.0, 0.0), (2.0, 0.0)), 1.0)),
    "solids": replace(GOOD, solids=GOOD.solids * (MAX_SOLIDS + 1)),
    "entries[0][2]": replace(GOOD, entries=((0.0, 0.0, nan),)),
    "mesh.format": replace(GOOD, mesh=MeshFile(b"", "fbx")),  # type: ignore[arg-type]
    "mesh.axes": replace(GOOD, mesh=MeshFile(b"", "obj", axes=((1.0, 0, 0),) * 3)),
    "mesh.unit": replace(GOOD, mesh=MeshFile(b"", "obj", unit=0.0)),
    "mesh.data": replace(GOOD, mesh=MeshFile(bytes(MAX_MESH_BYTES + 1), "obj")),
    "walkable.radius": walkable(radius=0.0),
    "walkable.step_height": walkable(step_height=1.0, height=0.9),
    "walkable.slope_deg": walkable(slope_deg=90.0),
    "walkable.height": walkable(height=True),
}


@pytest.mark.parametrize("field", BAD)
def test_an_error_names_the_field(field: str) -> None:
    with pytest.raises(InvalidArgument) as caught:
        check_spec(BAD[field])
    assert caught.value.field == field


def test_an_outline_has_a_bound() -> None:
    ring = tuple((float(k), float(k % 2)) for k in range(MAX_RING + 1))
    with pytest.raises(InvalidArgument, match="at most 2,000"):
        check_spec(SceneSpec((Floor(ring),)))


def test_all_outlines_together_have_a_bound() -> None:
    ring = tuple((float(k), float(k % 2)) for k in range(MAX_RING))
    with pytest.raises(InvalidArgument, match="outlines have 60,"):
        check_spec(replace(GOOD, solids=(Prism(ring, 1.0),) * 30))


def test_an_obstacle_has_few_corners() -> None:
    circle = tuple((cos(k / 50), sin(k / 50)) for k in range(300))
    with pytest.raises(InvalidArgument, match="at most 64"):
        check_obstacle(Prism(circle, 1.0), "obstacle")


def test_a_good_scene_passes() -> None:
    check_spec(GOOD)


def test_a_ramp_is_no_obstacle() -> None:
    with pytest.raises(InvalidArgument, match="Box, Cylinder or Prism"):
        check_obstacle(Ramp((0.0, 0.0), (1.0, 1.0), 1.0), "obstacle")  # type: ignore[arg-type]
