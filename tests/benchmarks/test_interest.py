"""A crowd in rings: an eighth of the bytes, and nobody pops in."""

from benchmarks import interest


def test_rings_take_an_eighth_of_the_bytes_and_nobody_pops_in():
    found = interest.measure_now(agents=60, seconds=24.0, phases=1)
    assert found["faults"] == []
    assert found["share"] <= interest.MOST
    assert found["near_share"] > 0.02
    assert found["entered"] >= 60 and found["left"] > 0  # the viewpoint goes across all
