"""What a load run counts, and the summary that is written."""

from dataclasses import dataclass, field
from typing import Any

from hdrh.histogram import HdrHistogram

MOST_S = 60.0
PERCENTILES = {"p50": 50.0, "p95": 95.0, "p99": 99.0, "p999": 99.9}


class Latencies:
    """Durations from 1 µs to a minute, to three digits; negative ones count as nothing."""

    def __init__(self) -> None:
        self.histogram = HdrHistogram(1, int(MOST_S * 1e6), 3)

    def add(self, seconds: float) -> None:
        """Count one."""
        self.histogram.record_value(int(min(max(seconds, 1e-6), MOST_S) * 1e6))

    @property
    def count(self) -> int:
        """How many have been counted."""
        return int(self.histogram.get_total_count())

    def milliseconds(self) -> dict[str, float] | None:
        """Percentiles and the greatest; None when there is nothing."""
        if not self.count:
            return None
        found = {n: self.histogram.get_value_at_percentile(p) for n, p in PERCENTILES.items()}
        return {n: v / 1e3 for n, v in found.items()} | {
            "max": self.histogram.get_max_value() / 1e3
        }


BIN_S = 0.2
"""Seconds of a row of `OverTime`: every agent has a primitive in each."""


@dataclass(slots=True)
class Interval:
    """What fell due in an interval."""

    due: int = 0
    missed: int = 0
    late_s: float = 0.0  # sum over all of them; who is early counts as on time
    most_s: float = 0.0


class OverTime:
    """Lateness over the time of a run."""

    def __init__(self) -> None:
        self._found: dict[int, Interval] = {}

    def add(self, at: float, late: float, missed: bool) -> None:
        """A primitive that fell due `at` seconds of measuring came so late, or never."""
        found = self._found.setdefault(int(at / BIN_S), Interval())
        found.due += 1
        found.missed += missed
        found.late_s += max(late, 0.0)
        found.most_s = max(found.most_s, late)

    def rows(self) -> list[dict[str, float]]:
        """In order of time; `at` is where an interval of `BIN_S` begins."""
        return [
            {
                "at": round(number * BIN_S, 3),
                "due": found.due,
                "missed": found.missed,
                "mean_ms": round(1e3 * found.late_s / found.due, 3),
                "max_ms": round(1e3 * found.most_s, 3),
            }
            for number, found in sorted(self._found.items())
        ]


@dataclass
class Tally:
    """Counts of one run, over all its clients."""

    lateness: Latencies = field(default_factory=Latencies)  # arrival - scheduled instant
    first_chunk: Latencies = field(default_factory=Latencies)  # from the call to the first batch
    goal_latency: Latencies = field(default_factory=Latencies)  # command to first changed pose
    refusal: Latencies = field(default_factory=Latencies)  # how long a refused creation took
    over_time: OverTime = field(default_factory=OverTime)  # lateness and misses by due time
    agents: int = 0  # admitted
    refused: int = 0  # agents that were not
    chunks: int = 0
    late: int = 0  # chunks that came after their last frame's time
    lost: int = 0  # primitives that never came
    silent: int = 0  # agents without any chunk
    repeated: int = 0  # chunks that had come before: a fault
    malformed: int = 0  # of a sample of chunks, those that hold no poses: a fault
    idle: int = 0  # chunks of agents who stand
    reduced: int = 0  # chunks with fewer candidates than set
    held: int = 0  # chunks that hold a pose
    goals: int = 0  # commands that were taken
    unanswered: int = 0  # goals that never showed
    failures: dict[str, int] = field(default_factory=dict)  # calls that failed, by status
    bytes: int = 0
    tiers: dict[int, list[int]] = field(default_factory=dict)  # chunks and bytes of each ring

    @property
    def misses(self) -> int:
        """Primitives that came too late or never."""
        return self.late + self.lost

    def sent(self, tier: int, chunks: int, size: int) -> None:
        """Count a message of `size` bytes with chunks of one ring."""
        self.bytes += size
        of_ring = self.tiers.setdefault(tier, [0, 0])
        of_ring[0] += chunks
        of_ring[1] += size

    def failed(self, status: str) -> None:
        """Count a call that failed."""
        self.failures[status] = self.failures.get(status, 0) + 1

    def summary(self, seconds: float) -> dict[str, Any]:
        """The figures of `seconds` of measuring."""
        return {
            "agents": self.agents,
            "seconds": round(seconds, 3),
            "chunks": self.chunks,
            "misses": self.misses,
            "miss_rate": self.misses / max(self.chunks + self.lost, 1),
            "lateness_ms": self.lateness.milliseconds(),
            "over_time": self.over_time.rows(),
            "first_chunk_ms": self.first_chunk.milliseconds(),
            "goal_latency_ms": self.goal_latency.milliseconds(),
            "goals": self.goals,
            "unanswered": self.unanswered,
            "refused": self.refused,
            "refusal_ms": self.refusal.milliseconds(),
            "reduced": self.reduced,
            "held": self.held,
            "idle_share": round(self.idle / max(self.chunks, 1), 3),
            "silent": self.silent,
            "repeated": self.repeated,
            "malformed": self.malformed,
            "failures": self.failures,
            "megabytes": round(self.bytes / 1e6, 3),
            "rings": [
                {"ring": tier, "chunks": chunks, "megabytes": round(size / 1e6, 3)}
                for tier, (chunks, size) in sorted(self.tiers.items())
            ],
        }
