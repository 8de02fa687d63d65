"""The number of agents a GPU steps in time is found at any speed, and reported with its reason."""

import time
from math import inf

import pytest
from benchmarks.curve import LEAST, Point, curve, ended_by

from benchmarks import gpu
from wayfarer.spec import STEP_SECONDS


def found(limit, memory=inf, until=inf):
    """The curve of a GPU that steps `limit` agents in time, with limited memory."""
    return list(curve(lambda n: Point(n, inf if n > memory else n * STEP_SECONDS / limit), until))


@pytest.mark.parametrize("limit", [64, 1000, 33_000, 262_144])
def test_the_most_agents_in_time_are_found_within_a_sixteenth(limit):
    points = found(limit)
    most = max(p.agents for p in points if p.in_time)
    assert limit * 15 / 16 - 1 <= most <= limit
    assert len({p.agents for p in points}) == len(points) < 24
    assert ended_by(points) == "0.2 s"


def test_where_memory_ends_first_it_is_told():
    points = found(100_000, memory=5000)
    assert 4600 < max(p.agents for p in points if p.in_time) <= 5000
    assert ended_by(points) == "memory"


def test_a_gpu_that_is_too_slow_for_the_least_batch_is_told_so():
    points = found(1)
    assert points[0].agents == LEAST
    assert sum(p.in_time for p in points) <= 1


def test_nothing_is_begun_when_the_time_is_up():
    points = found(1000, until=time.monotonic())
    assert points == []
    assert ended_by(points) == "time of the benchmark"


def test_ratios_are_of_the_largest_crowd_in_time():
    about = {"precision": "tf32", "candidates": 1, "kept_on": "device"}
    rows = [
        about | {"agents": n, "ms": ms, "of_gemm": of}
        for n, ms, of in ((64, 1.0, 9.0), (128, 150.0, 3.0), (256, 300.0, 2.0))
    ]
    rows.append(rows[0] | {"kept_on": "host"})
    assert gpu.ratios(rows) == {
        "GPU tf32 K=1: step / GEMM": {"value": 3.0, "better": "lower"},
    }
