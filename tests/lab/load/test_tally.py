import pytest

from wayfarer_lab.load.tally import Latencies, Tally


def test_percentiles_are_in_milliseconds_to_three_digits():
    latencies = Latencies()
    for ms in range(1, 1001):
        latencies.add(ms / 1000)
    found = latencies.milliseconds()
    assert found["p50"] == pytest.approx(500, rel=2e-3)
    assert found["p99"] == pytest.approx(990, rel=2e-3)
    assert found["max"] == pytest.approx(1000, rel=2e-3)


def test_what_came_early_or_absurdly_late_is_counted_within_the_range():
    latencies = Latencies()
    latencies.add(-0.03)
    latencies.add(1e9)
    assert latencies.count == 2
    assert latencies.milliseconds()["max"] == pytest.approx(60_000, rel=2e-3)


def test_nothing_counted_is_nothing_said():
    summary = Tally().summary(10.0)
    assert summary["lateness_ms"] is None
    assert summary["misses"] == 0 and summary["failures"] == {}
