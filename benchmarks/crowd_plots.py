"""Paths of a crowd from above."""

import numpy as np
import shapely
from PIL import Image

from benchmarks.crowd_cases import Case
from benchmarks.crowd_figures import Tracks
from wayfarer_lab.evaluation.pictures.paper import FAINT, GOAL, INK, PAPER
from wayfarer_lab.evaluation.pictures.top import TRAILS, ScaleDrawing

SIZE = (640, 640)


def draw(case: Case, tracks: Tracks) -> Image.Image:
    """Draws the ground, paths that begin with a dot, and goals as rings."""
    spots = tracks.place[np.isfinite(tracks.place).all(-1)]
    low, high = spots.min(0) - 1.0, spots.max(0) + 1.0
    if case.spec is not None:
        x0, y0, x1, y1 = shapely.total_bounds(case.ground)
        low, high = np.maximum(low, (x0 - 0.3, y0 - 0.3)), np.minimum(high, (x1 + 0.3, y1 + 0.3))
    drawing = ScaleDrawing(low, high, SIZE)
    drawing.area(shapely.box(*(low - 9), *(high + 9)), FAINT)
    drawing.area(case.ground, PAPER, holes=FAINT)
    for who in range(tracks.place.shape[1]):
        way = tracks.place[:, who]
        way = way[np.isfinite(way).all(-1)]
        goal = case.goals[who]
        forward = goal is None or goal.position[1] >= case.starts[who, 1]
        ink = INK if goal is None else TRAILS[0 if forward else 1]
        if len(way) > 1:
            drawing.line(way, ink, 1.2)
        drawing.disc(way[0], 3.0, ink)
        drawing.disc(way[-1], 0.21 * drawing.scale, ink, 1.5)
        if goal is not None:
            drawing.disc(np.array(goal.position[:2]), 3.0, GOAL, 1.0)
    return drawing.picture()
