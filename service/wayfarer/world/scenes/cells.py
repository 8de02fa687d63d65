"""Square cells of the floor with the people in them: a rule looks only at the people nearby."""

from functools import cache
from math import floor
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.world.rows import Float, Index

CELL: Final = 2.6
"""Side of a cell, metres. Everybody within this distance of a place is in the place's cell or in
one of the eight around it."""

SPAN: Final = 1 << 16
"""More than the number of cells along an axis: 7,700 for ten kilometres to either side."""


class Cells(NamedTuple):
    """Everybody [N] of some sessions, cell by cell."""

    keys: Index  # ascending: the session and the cell of each of `rows`
    rows: Index  # of everybody; ascending within a cell


@inner
def _key(first: int, column: int, line: int) -> int:
    return (first * SPAN + column) * SPAN + line


@inner
def bisect(numbers: Index, known: int, number: int) -> int:
    """Where a number stands, or would stand, among the first `known` of ascending numbers."""
    low, high = 0, known
    while low < high:
        middle = (low + high) // 2
        if numbers[middle] < number:
            low = middle + 1
        else:
            high = middle
    return low


@compiled
def cells_of(first: Index, place: Float) -> Cells:
    """The cells of everybody. `first` [N] is the first row of each one's session, `place` [N, 2]
    is in metres.
    """
    keys = np.empty(len(first), np.int64)
    for row in range(len(first)):
        keys[row] = _key(first[row], floor(place[row, 0] / CELL), floor(place[row, 1] / CELL))
    rows = np.argsort(keys, kind="mergesort")  # a stable one
    return Cells(keys[rows], rows)


@inner
def beside(cells: Cells, first: int, x: float, y: float, side: int) -> tuple[int, int]:
    """The range [begin, end) of `cells.rows` in three cells near a place (x, y): in its column
    (`side` 0), or in the column before or after it (-1, 1); of the session that begins with row
    `first`.
    """
    column, line = floor(x / CELL) + side, floor(y / CELL)
    count = len(cells.keys)
    begin = bisect(cells.keys, count, _key(first, column, line - 1))
    return begin, bisect(cells.keys, count, _key(first, column, line + 2))


@cache
def prepare() -> None:
    """Compiles the rule, or loads it, before agents walk."""
    warm(cells_of, np.zeros(1, np.int64), np.zeros((1, 2), np.float32))
