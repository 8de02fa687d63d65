"""A scene from above, as a PNG."""

from collections.abc import Sequence
from io import BytesIO
from math import ceil
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.grid import Grid
from wayfarer.navigation.paths.path import GroundPath
from wayfarer.navigation.scene import Scene
from wayfarer.navigation.solids import footprint

MIN_PIXELS: Final = 64
MAX_PIXELS: Final = 2048
_OUTSIDE, _GROUND, _OBSTACLE = (84, 92, 104), (214, 219, 226), (196, 122, 60)
_LOW, _HIGH = np.array([196.0, 224, 205]), np.array([92.0, 160, 120])
_INKS: Final = ("#2a6fb0", "#d1495b", "#7048b0", "#b06a00", "#0a7d7d")
_SMOOTH: Final = 2
"""Paths are drawn at this multiple of the size, then scaled down."""


def top_view(scene: Scene, paths: Sequence[GroundPath] = (), pixels: int = 800) -> bytes:
    """The scene as a PNG: x points right and y up. `pixels`: its longer side.

    Green: where an agent's middle may be (darker is higher); grey: the rest of the ground; brown:
    obstacles; lines: paths, with a dot at their goal. Raises InvalidArgument.
    """
    if not MIN_PIXELS <= pixels <= MAX_PIXELS:
        raise InvalidArgument(
            f"pixels is {pixels}, allowed is {MIN_PIXELS} to {MAX_PIXELS}", "pixels"
        )
    x0, y0, x1, y1 = scene.bounds
    cell = max(x1 - x0, y1 - y0) / (pixels * 0.96)
    grid = Grid.over((x0, y0, x1, y1), cell, margin=0.02 * pixels * cell)
    plain = Image.fromarray(_colours(scene, grid)[::-1].copy())
    image = plain.resize((grid.columns * _SMOOTH, grid.rows * _SMOOTH), Image.Resampling.NEAREST)
    draw = ImageDraw.Draw(image)
    for path, ink in zip(paths, _INKS * ceil(len(paths) / len(_INKS)), strict=False):
        _draw(draw, path, grid, ink)
    small = image.resize(plain.size, Image.Resampling.BOX)
    file = BytesIO()
    small.save(file, "PNG", optimize=True)
    return file.getvalue()


def _colours(scene: Scene, grid: Grid) -> NDArray[np.uint8]:
    """Colours of all cells, upper layers over lower ones. [rows, columns, 3]"""
    colours = np.empty((*grid.shape, 3), np.uint8)
    colours[:] = _OUTSIDE
    for layer in scene.ground.layers:
        colours[grid.fill(layer.own)] = _GROUND
    x, y = grid.middles()
    triangles = shapely.polygons(scene.mesh.corners)
    low, high = _extent(scene)
    for number, layer in enumerate(scene.ground.layers):
        free = grid.fill(shapely.union_all(triangles[scene.mesh.layer == number]))
        row, column = np.nonzero(free)
        height = layer.heights.at(np.column_stack([x[column], y[row]]))
        share = ((height - low) / max(high - low, 1.0))[:, None]
        colours[free] = (_LOW + share * (_HIGH - _LOW)).astype(np.uint8)
    for obstacle in scene.obstacles.values():
        colours[grid.fill(footprint(obstacle))] = _OBSTACLE
    return colours


def _extent(scene: Scene) -> tuple[float, float]:
    """The lowest and the highest ground of the mesh."""
    heights = [
        scene.ground.layers[number].heights.at(scene.mesh.corners[scene.mesh.layer == number])
        for number in np.unique(scene.mesh.layer)
    ]
    return min(float(h.min()) for h in heights), max(float(h.max()) for h in heights)


def _draw(draw: ImageDraw.ImageDraw, path: GroundPath, grid: Grid, ink: str) -> None:
    places = (grid.places(path.points) + 0.5) * _SMOOTH
    spots = [(float(x), float(grid.rows * _SMOOTH - y)) for x, y in places]
    wide = max(3, grid.columns * _SMOOTH // 200)
    draw.line(spots, fill=ink, width=wide, joint="curve")
    x, y = spots[-1]
    draw.ellipse((x - 2 * wide, y - 2 * wide, x + 2 * wide, y + 2 * wide), fill=ink)
