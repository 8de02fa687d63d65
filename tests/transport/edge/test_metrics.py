import threading

import numpy as np
import pytest

from wayfarer.runtime.metrics_sink import MetricsSink, ResumeResult
from wayfarer.runtime.stats import LoopStats
from wayfarer.runtime.streams.publications import SlowReader
from wayfarer.transport.edge.metrics import SIGHTS, Metrics
from wayfarer.world.agents.agent import AgentState, Sight


@pytest.fixture
def metrics():
    return Metrics()


def value(metrics: Metrics, name: str, **labels: str) -> float | None:
    return metrics.registry.get_sample_value("wayfarer_" + name, labels)


def test_what_the_loop_tells(metrics):
    meter: MetricsSink = metrics
    meter.step(0.01, 12)
    meter.chunks(np.array([-0.02, 0.01, 0.03]), np.array([Sight.NEAR, Sight.ROOT, Sight.NEAR]))
    meter.queue(0.2)
    meter.drops(SlowReader.HOLD, 3)
    meter.sent("whole", 7, 900)
    meter.resume(ResumeResult.GAP)
    meter.goal_to_motion(0.1)
    meter.refusal("create_agents")
    meter.journal(5, failed=False)
    assert value(metrics, "step_seconds_sum") == pytest.approx(0.01)
    assert value(metrics, "batch_size_sum") == 12
    counts = [value(metrics, "chunk_lateness_seconds_count", sight=sight) for sight in SIGHTS]
    assert counts == [2, 0, 1, 0]
    sums = [value(metrics, "chunk_lateness_seconds_sum", sight=sight) for sight in SIGHTS]
    assert sums == pytest.approx([0.03, 0, 0.01, 0])
    buckets = ("0.0", "0.005", "0.01", "0.025", "0.05", "+Inf")
    for sight, expected in (("near", [1, 1, 1, 1, 2, 2]), ("root", [0, 0, 1, 1, 1, 1])):
        name = "chunk_lateness_seconds_bucket"
        assert [value(metrics, name, sight=sight, le=bound) for bound in buckets] == expected
    misses = [value(metrics, "deadline_misses_total", sight=sight) for sight in SIGHTS]
    assert misses == [1, 0, 0, 0]  # more than a frame, 25 ms
    assert value(metrics, "stream_queue_seconds_count") == 1
    assert value(metrics, "stream_drops_total", policy="hold") == 3
    assert value(metrics, "stream_chunks_total", tier="whole") == 7
    assert value(metrics, "stream_bytes_total", tier="whole") == 900
    assert value(metrics, "resumes_total", result="gap") == 1
    assert value(metrics, "goal_latency_seconds_count") == 1
    assert value(metrics, "admission_rejections_total", reason="create_agents") == 1
    assert value(metrics, "journal_entries_total") == 5


def test_a_journal_that_fails_shows_until_it_is_written_again(metrics):
    metrics.journal(0, failed=True)
    assert (value(metrics, "journal_failing"), value(metrics, "journal_failures_total")) == (1, 1)
    metrics.journal(3, failed=False)
    assert (value(metrics, "journal_failing"), value(metrics, "journal_failures_total")) == (0, 1)


def test_how_the_loop_stands(metrics):
    assert value(metrics, "sessions") is None  # nobody has asked it yet
    stats = LoopStats(
        *(7, 2, 3, 100, 4.0, 5.0, 6, 7.0, 8.0),
        states={AgentState.WALKING: 4, AgentState.STANDING: 3},
        capacity=60,
        load=0.4,
        degradation_level=1,
        sights={"near": 2, "root": 5},
        skipped_by_sight={"root": 11},
        reduced_steps=9,
        mended_steps=2,
    )
    metrics.refresh(stats)
    states = {s: value(metrics, "agents", state=s) for s in AgentState}
    assert states == {"walking": 4, "standing": 3, "stopping": 0, "turning": 0}
    assert [value(metrics, "seen_agents", sight=sight) for sight in SIGHTS] == [2, 0, 5, 0]
    assert [value(metrics, "skipped_steps_total", sight=s) for s in SIGHTS] == [0, 0, 11, 0]
    names = ("sessions", "streams", "capacity_agents", "load", "degradation_level")
    assert [value(metrics, name) for name in names] == [2, 3, 60, 0.4, 1]
    assert value(metrics, "reduced_steps_total") == 9
    assert value(metrics, "mended_steps_total") == 2


def test_series_are_there_before_anything_happens(metrics):
    for policy in SlowReader:
        assert value(metrics, "stream_drops_total", policy=policy) == 0
    for result in ResumeResult:
        assert value(metrics, "resumes_total", result=result) == 0
    for sight in SIGHTS:
        assert value(metrics, "deadline_misses_total", sight=sight) == 0
        assert value(metrics, "chunk_lateness_seconds_count", sight=sight) == 0


def test_threads_at_the_same_time(metrics):
    def work() -> None:
        for _ in range(1000):
            metrics.chunks(np.array([0.1]), np.array([Sight.FAR]))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert value(metrics, "deadline_misses_total", sight="far") == 4000
    assert value(metrics, "chunk_lateness_seconds_count", sight="far") == 4000


def test_servers_do_not_share(metrics):
    metrics.chunks(np.array([1.0]), np.array([Sight.NEAR]))
    assert value(Metrics(), "deadline_misses_total", sight="near") == 0


def test_it_is_a_meter_in_full():
    told = [name for name in vars(MetricsSink) if not name.startswith("_")]
    assert told and set(told) <= set(vars(Metrics))
