"""Counters of a load run, and its written summary."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Self

from hdrh.histogram import HdrHistogram

from wayfarer.spec import NEW_FRAMES, POSED_JOINTS, STEP_SECONDS
from wayfarer_lab.load.rings import LoadRing

MAX_S = 60.0
PERCENTILES = {"p50": 50.0, "p95": 95.0, "p99": 99.0, "p999": 99.9}


class Latencies:
    """Durations from 1 µs to a minute, to three digits; negative ones count as nothing."""

    def __init__(self) -> None:
        self.histogram = HdrHistogram(1, int(MAX_S * 1e6), 3)

    @classmethod
    def sum(cls, parts: Iterable[Self]) -> Self:
        """All of several."""
        found = cls()
        for part in parts:
            found.histogram.add(part.histogram)
        return found

    def add(self, seconds: float, count: int = 1) -> None:
        """Counts some of the same duration."""
        self.histogram.record_value(int(min(max(seconds, 1e-6), MAX_S) * 1e6), count)

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
    late_s: float = 0.0  # sum over all of them; early primitives count as on time
    most_s: float = 0.0


class OverTime:
    """Lateness over the time of a run."""

    def __init__(self) -> None:
        self._found: dict[int, Interval] = {}

    @classmethod
    def sum(cls, parts: Iterable[Self]) -> Self:
        """All of several."""
        found = cls()
        for part in parts:
            for number, one in part._found.items():
                of_all = found._found.setdefault(number, Interval())
                of_all.due += one.due
                of_all.missed += one.missed
                of_all.late_s += one.late_s
                of_all.most_s = max(of_all.most_s, one.most_s)
        return found

    def add(self, at: float, late: float, missed: bool, count: int = 1) -> None:
        """Some primitives that fell due `at` seconds of measuring came so late, or never."""
        found = self._found.setdefault(int(at / BIN_S), Interval())
        found.due += count
        found.missed += count * missed
        found.late_s += count * max(late, 0.0)
        found.most_s = max(found.most_s, late)

    def rows(self) -> list[dict[str, float]]:
        """Rows in order of time; `at` is the start of an interval of `BIN_S`."""
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
class RingTally:
    """What came of one ring. A stream without rings has one, with everybody."""

    lateness: Latencies = field(default_factory=Latencies)  # arrival - scheduled instant
    over_time: OverTime = field(default_factory=OverTime)  # lateness and misses by due time
    chunks: int = 0
    late: int = 0  # chunks that came after their last frame's time
    lost: int = 0  # primitives that never came, of agents seen last in it
    reduced: int = 0  # chunks with fewer candidates than set
    held: int = 0  # chunks that hold a pose
    bytes: int = 0  # of messages, without descriptions of agents

    @property
    def misses(self) -> int:
        """Primitives that came too late or never."""
        return self.late + self.lost

    @property
    def due(self) -> int:
        """Primitives that should have come."""
        return self.chunks + self.lost

    def row(self, ring: str, seconds: float, agents: int) -> dict[str, Any]:
        """The figures of `seconds` of measuring; `agents` are those of all rings."""
        people = self.due * STEP_SECONDS / seconds  # seen in it, on average
        each = self.bytes / max(self.chunks, 1) / STEP_SECONDS / 1e3  # of an agent in the ring
        return {
            "ring": ring,
            "people": round(people, 2),
            "share": round(people / max(agents, 1), 4),
            "chunks": self.chunks,
            "misses": self.misses,
            "miss_rate": self.misses / max(self.due, 1),
            "lateness_ms": self.lateness.milliseconds(),
            "reduced": self.reduced,
            "held": self.held,
            "kb_s": round(self.bytes / seconds / 1e3, 2),
            "kb_s_person": round(each, 3) if each else None,
            "over_time": self.over_time.rows(),
        }


FULL_CHUNK_BYTES = NEW_FRAMES * (12 + 16 * POSED_JOINTS + 1)
"""Bytes of a primitive in full: frames of 22 bones in float32, and their contacts."""


@dataclass
class Tally:
    """Counts of one run, over all its clients."""

    rings: tuple[LoadRing, ...] = ()  # of its streams; none: everybody comes in full
    by_ring: defaultdict[int, RingTally] = field(default_factory=lambda: defaultdict(RingTally))
    first_chunk: Latencies = field(default_factory=Latencies)  # from the call to the first batch
    goal_latency: Latencies = field(default_factory=Latencies)  # command to first changed pose
    refusal: Latencies = field(default_factory=Latencies)  # how long a refused creation took
    agents: int = 0  # admitted
    refused: int = 0  # agents that were not
    silent: int = 0  # agents without any chunk
    repeated: int = 0  # chunks that had come before: a fault
    malformed: int = 0  # chunks of a sample that hold no poses: a fault
    popped: int = 0  # chunks of people who appear or jump without a word: a fault
    idle: int = 0  # chunks of standing agents
    goals: int = 0  # commands that were taken
    unanswered: int = 0  # goals that never showed
    failures: dict[str, int] = field(default_factory=dict)  # calls that failed, by status
    described: int = 0  # bytes of descriptions of agents that come into sight

    @property
    def lateness(self) -> Latencies:
        """Lateness of the primitives of all rings."""
        return Latencies.sum(ring.lateness for ring in self.by_ring.values())

    @property
    def chunks(self) -> int:
        """Primitives that came."""
        return sum(ring.chunks for ring in self.by_ring.values())

    @property
    def late(self) -> int:
        """Primitives that came too late."""
        return sum(ring.late for ring in self.by_ring.values())

    @property
    def lost(self) -> int:
        """Primitives that never came."""
        return sum(ring.lost for ring in self.by_ring.values())

    @property
    def misses(self) -> int:
        """Primitives that came too late or never."""
        return self.late + self.lost

    def failed(self, status: str) -> None:
        """Counts a call that failed."""
        self.failures[status] = self.failures.get(status, 0) + 1

    def summary(self, seconds: float) -> dict[str, Any]:
        """The figures of `seconds` of measuring."""
        rings = [self.by_ring[tier] for tier in sorted(self.by_ring)]
        size = self.described + sum(ring.bytes for ring in rings)
        full = self.agents * seconds / STEP_SECONDS * FULL_CHUNK_BYTES
        return {
            "agents": self.agents,
            "seconds": round(seconds, 3),
            "chunks": self.chunks,
            "misses": self.misses,
            "miss_rate": self.misses / max(self.chunks + self.lost, 1),
            "lateness_ms": self.lateness.milliseconds(),
            "over_time": OverTime.sum(ring.over_time for ring in rings).rows(),
            "first_chunk_ms": self.first_chunk.milliseconds(),
            "goal_latency_ms": self.goal_latency.milliseconds(),
            "goals": self.goals,
            "unanswered": self.unanswered,
            "refused": self.refused,
            "refusal_ms": self.refusal.milliseconds(),
            "reduced": sum(ring.reduced for ring in rings),
            "held": sum(ring.held for ring in rings),
            "idle_share": round(self.idle / max(self.chunks, 1), 3),
            "silent": self.silent,
            "repeated": self.repeated,
            "malformed": self.malformed,
            "popped": self.popped,
            "failures": self.failures,
            "megabytes": round(size / 1e6, 3),
            "rings": [
                self.by_ring[tier].row(ring.name, seconds, self.agents)
                for tier, ring in enumerate(self.rings)
            ],
            "unseen_share": round(self._unseen(seconds), 4),
            "of_full": round(size / full, 4) if full else None,
        }

    def _unseen(self, seconds: float) -> float:
        """Share of the agents beyond the last ring."""
        every = self.agents * seconds / STEP_SECONDS
        return max(1 - (self.chunks + self.lost) / every, 0.0) if self.rings and every else 0.0
