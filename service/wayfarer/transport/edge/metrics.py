"""Prometheus metrics of one server, in a separate registry. Names: docs/operations.md.

No label contains a client's text, so their number is bounded.
"""

import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import Final

import numpy as np
from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)
from prometheus_client.gc_collector import GCCollector
from prometheus_client.platform_collector import PlatformCollector
from prometheus_client.process_collector import ProcessCollector
from prometheus_client.registry import Collector
from prometheus_client.utils import floatToGoString

from wayfarer import __version__
from wayfarer.runtime.metrics_sink import SET_ASIDE, MetricsSink, ResumeResult, Seconds
from wayfarer.runtime.stats import LoopStats
from wayfarer.runtime.streams.publications import SlowReader
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.world.agents.agent import AgentState, Sight
from wayfarer.world.agents.faults import Stage
from wayfarer.world.rows import Int8

MISSED_S: Final = 1 / FPS
"""A chunk has missed its deadline if it leaves more than one frame after its time."""

PERIOD_S: Final = NEW_FRAMES / FPS
"""Time that a step may take: 0.2 s."""

SIGHTS: Final = tuple(sight.name.lower() for sight in Sight)
"""Labels, in the order of `Sight`."""

STEP_BUCKETS: Final = (0.002, 0.005, 0.01, 0.02, 0.04, 0.06, 0.08, 0.1, 0.14, PERIOD_S, 0.4, 1.0)
LATENESS_BUCKETS: Final = (0.0, 0.001, 0.002, 0.005, 0.01, 1 / FPS, 0.05, 0.1, PERIOD_S, 0.5, 1.0)
QUEUE_BUCKETS: Final = (0.001, 0.005, 0.025, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0)
CALL_BUCKETS: Final = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 1.0, 2.5, 10.0)
GOAL_BUCKETS: Final = (0.025, 0.05, 0.075, 0.1, 0.15, 0.2, 0.25, 0.3, 0.5, 1.0, 2.0)
BATCH_BUCKETS: Final = (1, 2, 4, 8, 16, 32, 64, 128, 256)


class Metrics(MetricsSink):
    """All metrics of the server."""

    def __init__(self, traced: Callable[[int, float], None] | None = None) -> None:
        """`traced` also receives every engine call: agents, seconds."""
        self.registry = registry = CollectorRegistry()
        self._traced = traced
        ProcessCollector(registry=registry)
        PlatformCollector(registry=registry)
        GCCollector(registry=registry)
        build = Gauge("wayfarer_build", "What runs; always 1", ["version"], registry=registry)
        build.labels(__version__).set(1)
        count, times = partial(_count, registry), partial(_times, registry)

        # the motion loop
        self._stand = _Stand()
        registry.register(self._stand)
        self._steps = times("step", "One engine call", STEP_BUCKETS)
        self._batches = Histogram(
            "wayfarer_batch_size", "Agents of one engine call", buckets=BATCH_BUCKETS,
            registry=registry,
        )  # fmt: skip
        self._misses = count("deadline_misses", "Chunks that left more than a frame late", "sight")
        self._lateness = _Lateness()
        registry.register(self._lateness)
        self._goals = times("goal_latency", "From a goal to its first frames", GOAL_BUCKETS)
        self._rejections = count(
            "admission_rejections", "Commands refused for want of room", "reason"
        )
        self._faults = count("faults", "Errors that were contained to an agent or session", "stage")
        self._set_aside = count(
            "set_aside", "Sessions and scenes taken out because they fail", "why"
        )

        # streams
        self._queues = times("stream_queue", "A publication waited for its reader", QUEUE_BUCKETS)
        self._drops = count("stream_drops", "Publications that slow readers lost", "policy")
        self._sent = count("stream_chunks", "Chunks sent to streams, by level of detail", "tier")
        self._bytes = count(
            "stream_bytes", "Bytes of messages with chunks, by level of detail", "tier"
        )
        self._resumes = count("resumes", "Streams that came back", "result")

        # the journal
        self._journal_entries = count("journal_entries", "Entries written")
        self._journal_failures = count("journal_failures", "Writes that failed")
        self._journal_failing = Gauge(
            "wayfarer_journal_failing", "1: the last write failed", registry=registry
        )

        # calls
        self._rpcs = times("rpc", "gRPC calls that are no streams", CALL_BUCKETS, "method", "code")
        self._http = times(
            "http", "HTTP requests that are no streams",
            CALL_BUCKETS, "method", "route", "status",
        )  # fmt: skip
        self._ends = count("stream_ends", "Streams that ended", "method", "code")

        # so that rates exist from the first event
        for policy in SlowReader:
            self._drops.labels(policy)
        for result in ResumeResult:
            self._resumes.labels(result)
        for sight in SIGHTS:
            self._misses.labels(sight)
        for stage in Stage:
            self._faults.labels(stage)
        for why in SET_ASIDE:
            self._set_aside.labels(why)
        for command in ("create_session", "create_agents"):
            self._rejections.labels(command)

    # the runtime's MetricsSink

    def step(self, seconds: float, agents: int) -> None:
        """Implements `MetricsSink`, as do the methods below."""
        self._steps.observe(seconds)
        self._batches.observe(agents)
        if self._traced:
            self._traced(agents, seconds)

    def chunks(self, lateness: Seconds, sights: Int8) -> None:
        """Implements `MetricsSink`."""
        self._lateness.observe(np.maximum(lateness, 0.0), sights)
        late = lateness > MISSED_S
        if late.any():
            missed = np.bincount(sights[late], minlength=len(SIGHTS)).tolist()
            for sight, count in zip(SIGHTS, missed, strict=True):
                self._misses.labels(sight).inc(count)

    def queue(self, seconds: float) -> None:
        """Implements `MetricsSink`."""
        self._queues.observe(seconds)

    def drops(self, policy: SlowReader, publications: int) -> None:
        """Implements `MetricsSink`."""
        self._drops.labels(policy).inc(publications)

    def sent(self, tier: str, chunks: int, size: int) -> None:
        """Implements `MetricsSink`."""
        self._sent.labels(tier).inc(chunks)
        self._bytes.labels(tier).inc(size)

    def resume(self, result: ResumeResult) -> None:
        """Implements `MetricsSink`."""
        self._resumes.labels(result).inc()

    def goal_to_motion(self, seconds: float) -> None:
        """Implements `MetricsSink`."""
        self._goals.observe(seconds)

    def refusal(self, command: str) -> None:
        """Implements `MetricsSink`."""
        self._rejections.labels(command).inc()

    def fault(self, stage: str) -> None:
        """Implements `MetricsSink`."""
        self._faults.labels(stage).inc()

    def set_aside(self, what: str) -> None:
        """Implements `MetricsSink`."""
        self._set_aside.labels(what).inc()

    def journal(self, entries: int, failed: bool) -> None:
        """Implements `MetricsSink`."""
        self._journal_entries.inc(entries)
        self._journal_failures.inc(failed)
        self._journal_failing.set(failed)

    # state of the loop

    def refresh(self, now: LoopStats) -> None:
        """Updates the figures of the present state; called before they are read."""
        self._stand.stats = now

    # calls

    def rpc(self, method: str, code: str, seconds: float) -> None:
        """Records a gRPC call; `method` is one of ours, `code` like INVALID_ARGUMENT."""
        self._rpcs.labels(method, code).observe(seconds)

    def http(self, method: str, route: str, status: int, seconds: float) -> None:
        """Records an HTTP request; `route` is a template, for example /v1/agents/{agent_id}."""
        self._http.labels(method, route, str(status)).observe(seconds)

    def stream_ended(self, method: str, code: str) -> None:
        """Records the end of a stream; `method` is gRPC's, or a route."""
        self._ends.labels(method, code).inc()


class _Stand(Collector):
    """The loop's own figures, read when metrics are collected."""

    def __init__(self) -> None:
        self.stats: LoopStats | None = None

    def collect(self) -> Iterator[Metric]:
        """Called by the registry."""
        now = self.stats
        if now is None:
            return
        agents = GaugeMetricFamily("wayfarer_agents", "Agents", labels=["state"])
        for state in AgentState:
            agents.add_metric([state], now.states.get(state, 0))
        yield agents
        seen = GaugeMetricFamily(
            "wayfarer_seen_agents", "Agents, by the reader that sees each best", labels=["sight"]
        )
        skipped = CounterMetricFamily(
            "wayfarer_skipped_steps", "Steps never made, their time being over", labels=["sight"]
        )
        for sight in SIGHTS:
            seen.add_metric([sight], now.sights.get(sight, 0))
            skipped.add_metric([sight], now.skipped_by_sight.get(sight, 0))
        yield from (seen, skipped)
        for name, what, value in (
            ("sessions", "Sessions", now.sessions),
            ("streams", "Subscriptions to motion", now.subscribers),
            ("held_sessions", "Sessions whose agents wait for a slow reader", now.held_sessions),
            ("capacity_agents", "Agents that fit, by the measured cost of a step", now.capacity),
            ("load", "Share of the time that the engine, or the loop, is busy", now.load),
            (
                "degradation_level",
                "What is left out for want of time; 0: nothing",
                now.degradation_level,
            ),
        ):
            yield GaugeMetricFamily(f"wayfarer_{name}", what, value)
        for name, what, value in (
            ("agent_steps", "Agents moved by one primitive", now.steps),
            ("reduced_steps", "Those with fewer candidates than asked for", now.reduced_steps),
            ("held_steps", "Those left out, the agent being idle", now.held_steps),
            ("coasted_steps", "Those made without the model, seen as a root", now.coasted_steps),
            ("refused_agents", "Agents refused for want of time", now.refused_agents),
            ("mended_steps", "Those with a knee kept within its limits", now.mended_steps),
            ("agent_resets", "Agents put back to a stand", now.resets),
            ("loop_failures", "Turns of the loop that raised", now.failures),
        ):
            yield CounterMetricFamily(f"wayfarer_{name}", what, value)


class _Lateness(Collector):
    """A histogram that takes many values in one call, which `Histogram` cannot."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts = np.zeros((len(SIGHTS), len(LATENESS_BUCKETS) + 1), np.int64)
        self._sums = np.zeros(len(SIGHTS))

    def observe(self, lateness: Seconds, sights: Int8) -> None:
        """Counts values."""
        width = self._counts.shape[1]
        places = np.searchsorted(LATENESS_BUCKETS, lateness) + width * sights.astype(np.int64)
        counts = np.bincount(places, minlength=self._counts.size).reshape(self._counts.shape)
        sums = np.bincount(sights, lateness, len(SIGHTS))
        with self._lock:
            self._counts += counts
            self._sums += sums

    def collect(self) -> Iterator[Metric]:
        """Called by the registry."""
        with self._lock:
            up_to, sums = np.cumsum(self._counts, axis=1).tolist(), self._sums.tolist()
        names = [*map(floatToGoString, LATENESS_BUCKETS), "+Inf"]
        found = HistogramMetricFamily(
            "wayfarer_chunk_lateness_seconds",
            "Chunk after its scheduled time, seconds",
            labels=["sight"],
        )
        for sight, counts, total in zip(SIGHTS, up_to, sums, strict=True):
            found.add_metric([sight], list(zip(names, counts, strict=True)), total)
        yield found


def _times(
    registry: CollectorRegistry, name: str, what: str, buckets: tuple[float, ...], *labels: str
) -> Histogram:
    return Histogram(
        f"wayfarer_{name}_seconds", f"{what}, seconds", labels, buckets=buckets, registry=registry
    )


def _count(registry: CollectorRegistry, name: str, what: str, *labels: str) -> Counter:
    return Counter(f"wayfarer_{name}", what, labels, registry=registry)
