import pytest

from wayfarer.errors import InvalidArgument
from wayfarer_lab.load.plan import LoadPlan


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        ({"sessions": 0}, "sessions"),
        ({"seconds": 0}, "seconds"),
        ({"slow": -1}, "slow"),
        ({"transport": "smoke signals"}, "transport"),
    ],
)
def test_impossible_plans_are_refused_by_name(wrong, field):
    with pytest.raises(InvalidArgument) as error:
        LoadPlan(**wrong)
    assert error.value.field == field
