"""What a load run shows: a table, a JSON file, a plot."""

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from wayfarer.load.tally import Latencies, Tally

SHOWN = {
    "lateness_ms": "lateness of primitives, ms",
    "first_chunk_ms": "first chunk, ms",
    "goal_latency_ms": "goal to first changed pose, ms",
    "refusal_ms": "refusal of agents, ms",
}


def show(summary: dict[str, Any], console: Console) -> None:
    """Print the figures."""
    table = Table("", "p50", "p95", "p99", "p99.9", "max")
    for key, title in SHOWN.items():
        if values := summary[key]:
            table.add_row(title, *(f"{value:.1f}" for value in values.values()))
    console.print(table)
    cpu = summary["cpu"]
    server = "–" if cpu["server"] is None else f"{cpu['server']:.2f}"
    console.print(
        f"{summary['agents']} agents ({summary['refused']} refused), {summary['chunks']} chunks, "
        f"[bold]{summary['misses']} missed[/bold], {summary['reduced']} reduced, "
        f"{summary['held']} held; CPU in cores: server {server}, "
        f"generator {cpu['generator']:.2f}"
    )
    if summary["failures"]:
        console.print(f"failed calls: {summary['failures']}")


def write(path: Path, summary: dict[str, Any], meta: dict[str, Any], tally: Tally | None) -> None:
    """Write `path` (JSON) and, beside it, a plot of the run's percentiles."""
    stamp = datetime.now(UTC).isoformat(timespec="seconds")
    document = summary | {"meta": meta | {"date": stamp}}
    path.write_text(json.dumps(document, indent=2) + "\n")
    if tally is not None:
        _plot(path.with_suffix(".png"), tally, summary["agents"])


def _plot(path: Path, tally: Tally, agents: int) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    for name, latencies in (
        ("lateness of primitives", tally.lateness),
        ("goal to first changed pose", tally.goal_latency),
    ):
        if latencies.count:
            axes.plot(*_curve(latencies), label=name)
    ticks = [0.5, 0.9, 0.99, 0.999, 0.9999]
    axes.set_xscale("log")
    axes.set_xticks([1 / (1 - t) for t in ticks], [f"{100 * t:g} %" for t in ticks])
    axes.set(xlabel="percentile", ylabel="ms", title=f"{agents} agents")
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=120)


def _curve(latencies: Latencies) -> tuple[list[float], list[float]]:
    """1 / (1 - share) and milliseconds, as HDR histograms are usually drawn."""
    shares = [1 - 10 ** (-k / 20) for k in range(6, 101)]
    known = [s for s in shares if (1 - s) * latencies.count >= 1] or shares[:1]
    values = [latencies.histogram.get_value_at_percentile(100 * s) / 1e3 for s in known]
    return [1 / (1 - s) for s in known], values
