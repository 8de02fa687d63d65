"""Values of a grid between its cells, compiled. Loaded by the first look-up: a bake has none."""

from functools import cache
from math import floor
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.process.compiled import compiled, warm

Array = NDArray[np.floating[Any]]


CELLS: Final = (0.0, 0.0, 1.0, 0.0)
"""The `frame` (see `sample`) of places that are given in cells."""


def bilinear(
    values: NDArray[np.float32],
    places: Array,
    frame: tuple[float, float, float, float] = CELLS,
) -> NDArray[np.float64]:
    """Values [rows, columns] at places [..., 2] of a frame, held constant beyond the border; see
    `sample`.
    """
    found = np.empty(places.shape[:-1])
    spots = np.ascontiguousarray(places, np.float64)
    sample(values, spots.reshape(-1, 2), frame, found.reshape(-1))
    return found


@compiled
def sample(
    values: NDArray[np.float32],
    places: NDArray[np.float64],
    frame: tuple[float, float, float, float],
    found: NDArray[np.float64],
) -> None:
    """Writes values at places [N, 2] into `found` [N]. `frame`: the origin (x, y) of the cells,
    their size, and where in its cell each value lies, in cells.
    """
    rows, columns = values.shape
    left, front, cell, middle = frame
    for k in range(len(found)):
        x, y = (places[k, 0] - left) / cell - middle, (places[k, 1] - front) / cell - middle
        if np.isnan(x) or np.isnan(y):
            found[k] = np.nan  # it would be a cell beyond the array
            continue
        x, y = min(max(x, 0.0), columns - 1.0), min(max(y, 0.0), rows - 1.0)
        c, r = min(floor(x), columns - 2), min(floor(y), rows - 2)
        x, y = x - c, y - r
        low = values[r, c] * (1 - x) + values[r, c + 1] * x
        high = values[r + 1, c] * (1 - x) + values[r + 1, c + 1] * x
        found[k] = low * (1 - y) + high * y


@cache
def prepare() -> None:
    """Compiles the rule, or loads it, before agents walk."""
    warm(sample, np.zeros((2, 2), np.float32), np.zeros((1, 2)), CELLS, np.zeros(1))
