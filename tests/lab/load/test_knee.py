import pytest

from wayfarer_lab.load.knee import FAULTS, find_knee, in_time


def summary(p99=10.0, **faults):
    return dict.fromkeys(FAULTS, 0) | {"lateness_ms": {"p99": p99}} | faults


@pytest.mark.parametrize("bad", [{"p99": 60.0}, *({fault: 1} for fault in FAULTS)])
def test_late_missed_refused_or_reduced_is_not_in_time(bad):
    assert in_time(summary(), 50.0)
    assert not in_time(summary(**bad), 50.0)


def test_who_got_nothing_was_not_served_in_time():
    assert not in_time(summary(lateness_ms=None), 50.0)


@pytest.mark.parametrize("limit", [0, 1, 137, 999, 1000, 5000])
async def test_the_knee_is_found_to_the_tolerance(limit):
    async def trial(agents):
        return summary(misses=agents > limit)

    found, trials = await find_knee(trial, 1000, 50.0, tolerance=0.02)
    assert found <= limit
    assert found >= min(limit, 1000) - max(1, 0.02 * limit + 1)
    assert len(trials) < 15
