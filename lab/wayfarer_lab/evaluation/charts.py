"""A report's figures as dots: a panel per figure, with a line for the recordings.

Dots rather than bars, since they need no zero: scores close to 1 stay distinguishable.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wayfarer_lab.evaluation.gait import MOCAP, Row

COLUMNS: Final = 4
PANEL: Final = (4.2, 0.6)
"""Inches: width of a panel, and its height without its rows."""

LINE: Final = 0.24
"""Height of a row in inches."""

MADE, RECORDED = "#2a6fb0", "#d1495b"


def draw(path: Path, tables: Mapping[str, Sequence[Row]], plots: Sequence[str] = ()) -> None:
    """Write a PNG with a panel for each of the figures `plots` (all that are floats if empty).

    A figure with companions named …_q25 and …_q75 gets whiskers between them.
    """
    panels = [
        (title, figure, [row for row in rows if math.isfinite(_number(row.get(figure)))])
        for title, rows in tables.items()
        for figure in (plots or _floats(rows))
    ]
    panels = [panel for panel in panels if panel[2]]
    if not panels:
        return
    lines = -(-len(panels) // COLUMNS)
    tallest = max(len(rows) for _, _, rows in panels)
    size = (PANEL[0] * min(COLUMNS, len(panels)), lines * (PANEL[1] + LINE * tallest))
    picture = Figure(figsize=size, dpi=100, layout="constrained")
    axes = picture.subplots(lines, min(COLUMNS, len(panels)), squeeze=False).ravel()
    for place, (title, figure, rows) in zip(axes, panels, strict=False):
        _dots(place, title if len(tables) > 1 else "", figure, rows)
    for place in axes[len(panels) :]:
        place.set_axis_off()
    FigureCanvasAgg(picture).print_png(str(path))


def _dots(axes: Axes, title: str, figure: str, rows: Sequence[Row]) -> None:
    names, values = [str(row["name"]) for row in rows], [_number(row.get(figure)) for row in rows]
    colours = [RECORDED if name.startswith(MOCAP) else MADE for name in names]
    axes.grid(axis="y", color="#e3e6ea")
    axes.set_axisbelow(True)
    axes.scatter(values, range(len(rows)), c=colours, s=22, zorder=2)
    for place, row in enumerate(rows):
        whisker = [_number(row.get(f"{figure}_{end}")) for end in ("q25", "q75")]
        axes.plot(whisker, [place, place], color="#30343a", linewidth=1)  # NaN: not drawn
    recorded = [v for name, v in zip(names, values, strict=True) if name.startswith(MOCAP)]
    if len(recorded) == 1:
        axes.axvline(recorded[0], color=RECORDED, linestyle="--", linewidth=1)
    axes.set_yticks(range(len(rows)), names, fontsize=7)
    axes.tick_params(axis="x", labelsize=7)
    axes.invert_yaxis()
    axes.set_title(f"{title}: {figure}" if title else figure, fontsize=8)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _floats(rows: Sequence[Row]) -> list[str]:
    """Figures that are neither counts nor whiskers."""
    found = dict.fromkeys(k for row in rows for k, v in row.items() if isinstance(v, float))
    return [name for name in found if not name.endswith(("_q25", "_q75"))]


def _number(value: float | int | str | None) -> float:
    return float(value) if isinstance(value, int | float) else math.nan
