import pytest

from wayfarer_lab.load.tally import BIN_S, Latencies, OverTime, Tally


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


def test_lateness_over_time_is_told_by_when_primitives_fell_due():
    over_time = OverTime()
    over_time.add(0.05, -0.02, False)
    over_time.add(0.15, 0.3, True)
    over_time.add(3 * BIN_S + 0.01, 0.01, False)
    first, last = over_time.rows()
    assert first == {"at": 0.0, "due": 2, "missed": 1, "mean_ms": 150.0, "max_ms": 300.0}
    assert last["at"] == pytest.approx(3 * BIN_S) and last["missed"] == 0
