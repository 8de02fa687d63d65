import pytest

from wayfarer.errors import InvalidArgument
from wayfarer_lab.load.plan import LoadPlan
from wayfarer_lab.load.rings import LoadRing


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        ({"sessions": 0}, "sessions"),
        ({"seconds": 0}, "seconds"),
        ({"slow": -1}, "slow"),
        ({"transport": "smoke signals"}, "transport"),
        ({"area": 0}, "area"),
        ({"viewpoint_speed": float("inf")}, "viewpoint_speed"),
        ({"rings": (LoadRing("full", 3.0), LoadRing("root", 2.0))}, "rings"),
    ],
)
def test_impossible_plans_are_refused_by_name(wrong, field):
    with pytest.raises(InvalidArgument) as error:
        LoadPlan(**wrong)
    assert error.value.field == field
