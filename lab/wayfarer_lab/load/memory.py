"""The server's memory over a load run: does it settle or keep growing?"""

import asyncio
import time
from typing import Any

from wayfarer_lab.load.target import Target

SAMPLES = 240
"""Of one run, at most; no more often than once in a tenth of a second."""


class MemoryWatch:
    """Samples the resident memory of a server that is ours, in megabytes."""

    def __init__(self, target: Target, start: float, until: float) -> None:
        """Unix seconds: measuring begins at `start`, after the warm-up, and ends at `until`."""
        self._target = target
        self._start = start
        self._interval = max((until - time.time()) / SAMPLES, 0.1)
        self.samples: list[tuple[float, float]] = []  # seconds of measuring, megabytes

    async def run(self) -> None:
        """Sample until cancelled."""
        while self.sample():
            await asyncio.sleep(self._interval)

    def sample(self) -> bool:
        """Take a sample; False for a server that we did not start."""
        megabytes = self._target.resident_megabytes()
        if megabytes is not None:
            self.samples.append((round(time.time() - self._start, 3), round(megabytes, 2)))
        return megabytes is not None

    def summary(self) -> dict[str, Any] | None:
        """At the start of the run, after its warm-up, at the end; and all samples.

        `growth`: of the end beyond the warm-up, as a share. None when nothing was seen.
        """
        if not self.samples:
            return None
        first, last = self.samples[0][1], self.samples[-1][1]
        warm = next((megabytes for seconds, megabytes in self.samples if seconds >= 0), last)
        return {
            "start": first,
            "warm": warm,
            "end": last,
            "growth": round(last / warm - 1, 4),
            "samples": self.samples,
        }
