import pytest

from wayfarer.errors import InvalidArgument
from wayfarer.v1 import motion_pb2
from wayfarer_lab.load.plan import FAR, MIDDLE, LoadPlan

PLAIN = motion_pb2.PoseFormat()


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        ({"sessions": 0}, "sessions"),
        ({"seconds": 0}, "seconds"),
        ({"slow": -1}, "slow"),
        ({"transport": "smoke signals"}, "transport"),
        ({"rings": (3.0, 2.0)}, "rings"),
        ({"rings": (0.0,)}, "rings"),
        ({"rings": (1.0, float("inf"))}, "rings"),
    ],
)
def test_impossible_plans_are_refused_by_name(wrong, field):
    with pytest.raises(InvalidArgument) as error:
        LoadPlan(**wrong)
    assert error.value.field == field


@pytest.mark.parametrize(
    ("radii", "formats"),
    [
        ((3.0,), [PLAIN]),
        ((3.0, 6.0), [PLAIN, FAR]),
        ((3.0, 6.0, 9.0, 12.0), [PLAIN, MIDDLE, MIDDLE, FAR]),
    ],
)
def test_rings_are_full_poses_then_fewer_frames_then_roots(radii, formats):
    rings = LoadPlan(rings=radii).interest().rings
    assert [(ring.radius, ring.format) for ring in rings] == list(zip(radii, formats, strict=True))


def test_without_radii_there_are_no_rings():
    assert LoadPlan().interest() is None
