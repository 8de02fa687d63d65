"""A crowd in rings: an eighth of the bytes, and nobody pops in."""

import pytest

from benchmarks import interest


def test_rings_take_an_eighth_of_the_bytes_and_nobody_pops_in():
    found = interest.measure_now(agents=60, seconds=24.0, phases=1)
    assert found["faults"] == []
    assert found["share"] <= interest.MOST
    assert found["near_share"] > 0.02
    assert found["entered"] >= 60 and found["left"] > 0  # the viewpoint goes across all


@pytest.mark.slow
def test_so_it_is_with_a_thousand_people_of_whom_one_in_twenty_is_near():
    found = interest.measure_now(agents=1000, seconds=10.0, phases=1)
    assert found["faults"] == []
    assert found["share"] <= interest.MOST
    assert found["near_share"] == pytest.approx(interest.NEAR_SHARE, abs=0.01)
    per_person = [ring["kB_s_person"] for ring in found["rings"].values()]
    assert per_person[0] > 5 * per_person[1] > 25 * per_person[2]
