"""Long runs of readers that stall and readers that leave, on a separate server.

    python -m benchmarks.streams --seconds 60 --cycles 1000

One reader stalls for `seconds` among 63 healthy ones (8 sessions of 1 agent, that of the stalled
reader of 4), once over gRPC and once over WebSocket; then `cycles` streams are opened and left.
Ends with 1 when a healthy reader lost a chunk or got one after its time, or when memory grew.
"""

import argparse
import asyncio
import sys

from tests.fuzz import streams
from tests.serving import Service

HEALTHY = 63
SESSIONS = 8
AGENTS = 1
SHOWN_MS = 200.0
"""Milliseconds of lateness after which all frames of a chunk are over."""

WARM_UP_S = 60.0
"""Seconds until memory settles: motion kept for resuming readers, buffers for each batch size."""

GROWTH = 0.05
"""Share of its memory by which the server may grow."""


async def main() -> int:
    """Runs it; returns 0 if all is well."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--cycles", type=int, default=1000)
    asked = parser.parse_args()
    faults = []
    for kind in streams.STALLS:
        with Service(settings=streams.SETTINGS) as server:
            stall = await streams.stall(
                server.target, asked.seconds, SESSIONS, AGENTS, HEALTHY, kind, WARM_UP_S
            )
            found = streams.summary(stall)
            print(f"stalled {kind} reader, {asked.seconds:g} s: {found}")
            if found["lost"] or found["lateness_ms"]["p100"] > SHOWN_MS:
                faults.append(f"{kind}: healthy readers were disturbed")
            faults += grown(*stall.megabytes, f"{kind} stall") + server.errors
    with Service(settings=streams.SETTINGS) as server:
        before, after, stats = await streams.cycles(server.target, asked.cycles, seed=1)
        print(f"{asked.cycles} cycles: {before:.1f} → {after:.1f} MB, {stats}")
        faults += grown(before, after, "cycles") + server.errors
    for fault in faults:
        print(f"FAULT {fault}")
    return 1 if faults else 0


def grown(before: float, after: float, what: str) -> list[str]:
    """A line if memory grew by more than it may."""
    return [f"{what}: {before:.1f} → {after:.1f} MB"] if after > before * (1 + GROWTH) else []


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))
