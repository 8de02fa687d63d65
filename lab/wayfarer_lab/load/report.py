"""Results of a load run: a table, a JSON file, a plot."""

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from wayfarer_lab.load.tally import Latencies, Tally

SHOWN = {
    "lateness_ms": "lateness of primitives, ms",
    "first_chunk_ms": "first chunk, ms",
    "goal_latency_ms": "goal to first changed pose, ms",
    "refusal_ms": "refusal of agents, ms",
}


FAULTS = ("silent", "unanswered", "repeated", "malformed", "popped")

MAX_GENERATOR_LOAD = 0.7
"""Cores used by the generator above which it may itself be late."""


def show(summary: dict[str, Any], console: Console) -> None:
    """Prints the figures."""
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
        f"{summary['held']} held, {100 * summary['idle_share']:.0f} % of agents standing; "
        f"CPU in cores: server {server}, generator {cpu['generator']:.2f}"
    )
    if cpu["generator"] > MAX_GENERATOR_LOAD:
        console.print("[yellow]the generator itself is busy: some of this lateness is its own")
    if memory := summary["server_rss_mb"]:
        console.print(
            f"server memory, MB: {memory['start']:.0f} at first, {memory['warm']:.0f} after the "
            f"warm-up, {memory['end']:.0f} at the end ({memory['growth']:+.1%})"
        )
    if summary["rings"]:
        _show_rings(summary, console)
    if faults := {name: summary[name] for name in FAULTS if summary[name]}:
        console.print(f"[red]faults: {faults}")
    if summary["failures"]:
        console.print(f"failed calls: {summary['failures']}")


def _show_rings(summary: dict[str, Any], console: Console) -> None:
    table = Table("ring", "people", "missed", "p50 ms", "p99", "max", "reduced", "kB/s", "each")
    table.columns[0].no_wrap = table.columns[1].no_wrap = True
    for ring in summary["rings"]:
        late, each = ring["lateness_ms"] or {}, ring["kb_s_person"]
        table.add_row(
            *(ring["ring"], f"{ring['people']:.0f} ({ring['share']:.0%})", str(ring["misses"])),
            *(f"{late[key]:.0f}" if late else "–" for key in ("p50", "p99", "max")),
            *(str(ring["reduced"]), f"{ring['kb_s']:.1f}", "–" if each is None else f"{each:.2f}"),
        )
    console.print(table)
    console.print(
        f"out of sight: {summary['unseen_share']:.1%} of the people; the streams have "
        f"{summary['of_full']:.1%} of the bytes of everybody in full"
    )


def write(path: Path, summary: dict[str, Any], meta: dict[str, Any], tally: Tally) -> None:
    """Writes `path` (JSON) and, in its folder, a plot of the run's percentiles."""
    _write_json(path, summary, meta)
    _plot(path.with_suffix(".png"), tally, summary)


def write_knee(
    path: Path, found: int, trials: list[dict[str, Any]], p99_ms: float, meta: dict[str, Any]
) -> None:
    """Writes `path` (JSON) and, in its folder, a plot of lateness and misses over agents."""
    _write_json(path, {"knee": found, "p99_ms": p99_ms, "trials": trials}, meta)
    _plot_knee(path.with_suffix(".png"), found, trials, p99_ms)


def _write_json(path: Path, document: dict[str, Any], meta: dict[str, Any]) -> None:
    stamp = datetime.now(UTC).isoformat(timespec="seconds")
    path.write_text(json.dumps(document | {"meta": meta | {"date": stamp}}, indent=2) + "\n")


def _plot(path: Path, tally: Tally, summary: dict[str, Any]) -> None:
    from matplotlib.figure import Figure

    memory = summary["server_rss_mb"]
    count = 3 if memory else 2
    figure = Figure(figsize=(7, 3.5 * count), layout="constrained")
    upper, middle, *lower = figure.subplots(count, squeeze=False).flat
    _plot_latencies(upper, tally, summary["agents"])
    plot_over_time(middle, summary["over_time"])
    for axes in lower:
        axes.plot(*zip(*memory["samples"], strict=True))
        axes.set(xlabel="seconds of measuring", ylabel="server memory, MB")
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)


def plot_over_time(axes: Any, rows: list[dict[str, float]]) -> None:
    """The greatest and the mean lateness of each moment, and the share that was missed."""
    at = [row["at"] for row in rows]
    axes.plot(at, [row["max_ms"] for row in rows], label="greatest lateness", linewidth=1)
    axes.plot(at, [row["mean_ms"] for row in rows], label="mean", linewidth=1)
    axes.set_yscale("symlog", linthresh=10)
    axes.set(xlabel="seconds of measuring", ylabel="ms", ylim=(0, None))
    axes.grid(alpha=0.3)
    missed = axes.twinx()
    shares = [100 * row["missed"] / row["due"] for row in rows]
    missed.fill_between(at, shares, step="post", color="red", alpha=0.3, label="missed, %")
    missed.set(ylabel="missed, %", ylim=(0, 100))
    lines = [*axes.get_legend_handles_labels()[0], *missed.get_legend_handles_labels()[0]]
    axes.legend(lines, [line.get_label() for line in lines], loc="upper right")


def _plot_latencies(axes: Any, tally: Tally, agents: int) -> None:
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
    if axes.get_lines():
        axes.legend()


def _plot_knee(path: Path, found: int, trials: list[dict[str, Any]], p99_ms: float) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    ordered = sorted((t for t in trials if t["lateness_ms"]), key=lambda trial: trial["agents"])
    agents = [trial["agents"] for trial in ordered]
    axes.plot(agents, [trial["lateness_ms"]["p99"] for trial in ordered], "o-", label="p99, ms")
    axes.axhline(p99_ms, color="gray", linestyle="--", label="p99 that is in time")
    axes.set_yscale("log")
    axes.set(xlabel="agents", ylabel="lateness, ms", title=f"in time: {found} agents")
    if found:
        axes.axvline(found, color="green", alpha=0.5)
    rates = axes.twinx()
    rates.plot(agents, [100 * trial["miss_rate"] for trial in ordered], "rx", label="missed, %")
    rates.set(ylabel="missed, %", ylim=(0, None))
    figure.legend(loc="outside lower center", ncols=3)
    figure.savefig(path, dpi=120)


def _curve(latencies: Latencies) -> tuple[list[float], list[float]]:
    """1 / (1 - share) and milliseconds, as HDR histograms are usually drawn."""
    shares = [1 - 10 ** (-k / 20) for k in range(6, 101)]
    known = [s for s in shares if (1 - s) * latencies.count >= 1] or shares[:1]
    values = [latencies.histogram.get_value_at_percentile(100 * s) / 1e3 for s in known]
    return [1 / (1 - s) for s in known], values
