"""Pictures of training: trails of the same agents seen from above, epoch after epoch (Fig. 5)."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from torch import Tensor


def draw_trails(path: Path, hips: Tensor, goals: Tensor, clones: int, title: str) -> None:
    """Write a PNG of trails: hips [T, A, 3] (NaN when no longer going), goals [A, 3].

    `clones` agents after one another share start and goal, hence a colour. A ring is a goal, a dot
    the end of a trail.
    """
    figure = Figure(figsize=(6, 6), dpi=100)
    axes = figure.add_subplot()
    colours = matplotlib.colormaps["tab20"]
    trails, places = hips[..., :2].numpy(), goals[..., :2].numpy()
    for agent in range(trails.shape[1]):
        colour = colours(agent // clones % colours.N)
        trail = trails[np.isfinite(trails[:, agent]).all(-1), agent]
        axes.plot(*trail.T, color=colour, linewidth=0.8)
        axes.plot(*trail[-1], ".", color=colour, markersize=4)
        if agent % clones == 0:
            axes.plot(*places[agent], "o", color=colour, fillstyle="none", markersize=10)
    axes.set_aspect("equal")
    axes.set_title(title, fontsize=10)
    axes.grid(alpha=0.3)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, bbox_inches="tight")
