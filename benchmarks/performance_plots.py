"""Plots of the performance page."""

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

Part = dict[str, Any]

SERIES = ("engine", "candidates", "threads")


def draw(folder: Path, file: str, name: str, part: Part) -> str | None:
    """Draws a part, if it has a plot; returns `file`, or None."""
    pictures = {"step": step, "paper_s3": paper_s3, "memory": memory}
    drawn = next((draw for kind, draw in pictures.items() if name.startswith(kind)), None)
    if drawn is None or not part.get("rows"):
        return None
    figure = drawn(part)
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / file, dpi=100)
    return file


def step(part: Part) -> Figure:
    """Cost of an agent, as a multiple of its matrix products, over the batch; and where it goes."""
    shares = part["shares"]
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for key in dict.fromkeys(tuple(row[column] for column in SERIES) for row in part["rows"]):
        rows = [row for row in part["rows"] if tuple(row[column] for column in SERIES) == key]
        engine, candidates, threads = key
        left.plot(
            [row["batch"] for row in rows],
            [row["of_gemm"] for row in rows],
            "o-" if threads == 1 else "s--",
            markersize=3,
            label=f"{engine}, K = {candidates}, {threads} thr.",
        )
    left.axhline(1, color="black", linewidth=0.8)
    left.set(xscale="log", xlabel="batch", ylabel="step / its GEMM at the ceiling", ylim=(0, None))
    left.legend(fontsize=6)
    counts = sorted({share["candidates"] for share in shares})
    below = dict.fromkeys(counts, 0.0)
    for operators in dict.fromkeys(share["operators"] for share in shares):
        own = {s["candidates"]: s["share"] for s in shares if s["operators"] == operators}
        heights = [100 * own.get(count, 0.0) for count in counts]
        places = [f"K = {count}" for count in counts]
        right.bar(places, heights, bottom=[below[c] for c in counts], label=operators)
        for count, height in zip(counts, heights, strict=True):
            below[count] += height
    right.set(ylabel="% of a step, onnxruntime", ylim=(0, 100))
    right.legend(fontsize=6)
    return figure


def paper_s3(part: Part) -> Figure:
    """Seconds of a primitive over bodies, with the paper's."""
    figure = Figure(figsize=(5, 3.4), layout="constrained")
    axes = figure.subplots()
    rows = part["rows"]
    bodies = [row["bodies"] for row in rows]
    axes.plot(bodies, [min(r["one_call_s"], r["best_calls_s"]) for r in rows], "o-", label="ours")
    paper = [(row["bodies"], row["paper_s"]) for row in rows if row["paper_s"]]
    axes.plot(*zip(*paper, strict=True), "s--", label="paper, one Quadro 6000")
    axes.axhline(0.2, color="gray", linewidth=0.8, label="real time")
    axes.set(xscale="log", yscale="log", xlabel="bodies", ylabel="seconds for a primitive")
    axes.set_xticks(bodies, [str(count) for count in bodies])
    axes.legend()
    return figure


def memory(part: Part) -> Figure:
    """Resident set over agents."""
    figure = Figure(figsize=(5, 3), layout="constrained")
    axes = figure.subplots()
    axes.plot([r["agents"] for r in part["rows"]], [r["rss_mb"] for r in part["rows"]], "o-")
    axes.set(xlabel="agents", ylabel="RSS, MB", ylim=(0, None))
    axes.grid(alpha=0.3)
    return figure
