"""Values of a grid between its cells, compiled. Loaded by the first look-up: a bake has none."""

from functools import cache
from math import floor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.process.compiled import compiled, warm

Array = NDArray[np.floating[Any]]


def bilinear(values: NDArray[np.float32], places: Array) -> NDArray[np.float64]:
    """Values [rows, columns] at places [..., 2] in cells, held constant beyond the border."""
    found = np.empty(places.shape[:-1])
    spots = np.ascontiguousarray(places, np.float64)
    sample(values, spots.reshape(-1, 2), found.reshape(-1))
    return found


@compiled
def sample(
    values: NDArray[np.float32], places: NDArray[np.float64], found: NDArray[np.float64]
) -> None:
    """Into `found` [N]; places [N, 2]."""
    rows, columns = values.shape
    for k in range(len(found)):
        if np.isnan(places[k, 0]) or np.isnan(places[k, 1]):
            found[k] = np.nan  # it would be a cell beyond the array
            continue
        x = min(max(places[k, 0], 0.0), columns - 1.0)
        y = min(max(places[k, 1], 0.0), rows - 1.0)
        c, r = min(floor(x), columns - 2), min(floor(y), rows - 2)
        x, y = x - c, y - r
        low = values[r, c] * (1 - x) + values[r, c + 1] * x
        high = values[r + 1, c] * (1 - x) + values[r + 1, c + 1] * x
        found[k] = low * (1 - y) + high * y


@cache
def prepare() -> None:
    """Compiles the rule, or loads it, before agents walk."""
    warm(sample, np.zeros((2, 2), np.float32), np.zeros((1, 2)), np.zeros(1))
