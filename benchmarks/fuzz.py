"""Hostile inputs for a separate server: what does it answer, and does it stay healthy?

    python -m benchmarks.fuzz --inputs 100000 --seed 1

Raw bytes into every gRPC method, frames into both WebSockets, bodies into every HTTP route, and
plain garbage into both ports: random, mutated, truncated and oversized messages, and well-formed
ones with values such as NaN, infinities and the largest numbers. A well-behaved client streams
agents meanwhile. Ends with 1 when an input was answered with an internal error (or none at
all), when the server logged an error or ended, when a chunk left late, or when memory grew.
"""

import argparse
import asyncio
import json
import sys
from pathlib import Path

from tests.fuzz.campaign import SETTINGS, Report, run
from tests.serving import Service

SURFACES = ("gRPC", "WebSocket", "HTTP", "gRPC port", "HTTP port")
SAY_EVERY = 10_000
"""Number of inputs between two progress lines."""

GROWTH = 0.05
"""Share of its memory by which the server may grow after the first fifth of the inputs."""


def arguments() -> argparse.Namespace:
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--agents", type=int, default=8, help="of the client who behaves")
    parser.add_argument("--json", type=Path, help="write the figures there, too")
    return parser.parse_args()


class Progress:
    """Progress lines of a run that takes minutes."""

    def __init__(self) -> None:
        self._next = SAY_EVERY

    def __call__(self, report: Report) -> None:
        """Prints a line when enough inputs have passed since the last one."""
        if report.answers.inputs >= self._next:
            self._next += SAY_EVERY
            answers = report.answers
            print(f"{answers.inputs} inputs, {answers.failed} answered wrongly", flush=True)


def faults(report: Report, errors: list[str]) -> list[str]:
    """Faults of the run."""
    found = list(report.answers.failures)
    found += [f"logged: {error}" for error in errors[:10]]
    if report.failed_turns or report.resets:
        found.append(f"{report.failed_turns} turns failed, {report.resets} agents were reset")
    if report.late_chunks:
        found.append(f"{report.late_chunks} chunks left late")
    if report.megabytes and report.growth_megabytes > GROWTH * report.megabytes[0]:
        found.append(f"memory grew by {report.growth_megabytes:.1f} MB")
    return found


def show(report: Report) -> None:
    """Figures for people."""
    answers, stream = report.answers, report.stream
    print(f"{answers.inputs} inputs in {report.seconds:.0f} s, {answers.failed} answered wrongly")
    print(f"  kinds: {dict(answers.kinds.most_common())}")
    for surface in SURFACES:
        print(f"  {surface}: {answers.of(surface)}")
    memory = " → ".join(f"{megabytes:.1f}" for megabytes in report.megabytes)
    print(f"memory of the server: {memory} MB")
    print(f"healthy stream: {stream.chunks} chunks, {stream.misses} missed or too late to be shown")
    print(f"  lateness at the client, ms: {stream.lateness.milliseconds()}")
    print(f"  chunks that left the server more than a frame late: {report.late_chunks}")


async def main() -> int:
    """Runs it; returns 0 if all is well."""
    asked = arguments()
    with Service(settings=SETTINGS) as server:
        report = await run(server.target, asked.inputs, asked.seed, asked.agents, Progress())
        found = faults(report, server.errors)
    show(report)
    for fault in found:
        print(f"FAULT {fault}")
    if asked.json:
        figures = report.stream.summary(report.seconds)
        figures |= {"inputs": report.answers.inputs, "megabytes": report.megabytes, "faults": found}
        asked.json.write_text(json.dumps(figures, indent=2) + "\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))
