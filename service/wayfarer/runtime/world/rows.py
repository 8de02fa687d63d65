"""Struct of arrays: columns of equal length that are read and written by row.

The annotations declare the columns:

    class Goals(Rows):
        given: NDArray[np.bool_]                                # [N]
        position: Annotated[NDArray[np.float32], Shape(3)]      # [N, 3]
        history: OtherRows                                      # columns within columns
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, NamedTuple, Self, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.int64]
"""Row numbers."""


@dataclass(frozen=True, slots=True)
class Shape:
    """Shape of one row of a column."""

    sizes: tuple[int, ...]

    def __init__(self, *sizes: int) -> None:
        object.__setattr__(self, "sizes", sizes)


class Column(NamedTuple):
    """One array of a column set."""

    path: str  # "gait.speed"
    dtype: np.dtype[Any]
    shape: tuple[int, ...]  # of one row


@dataclass(slots=True, eq=False)
class Rows:
    """Base of column sets; sub-classes are dataclasses, too."""

    @classmethod
    def empty(cls, rows: int) -> Self:
        """Zeroed columns."""
        return cls(
            **{
                name: kind.empty(rows)
                if isinstance(kind, type) and issubclass(kind, Rows)
                else np.zeros((rows, *shape), kind)
                for name, kind, shape in _columns(cls)
            }
        )

    @classmethod
    def join(cls, parts: Sequence[Self]) -> Self:
        """The rows of all `parts`, at least one, in order."""
        joined: dict[str, Any] = {}
        for name, kind, _ in _columns(cls):
            values = [getattr(part, name) for part in parts]
            is_rows = isinstance(kind, type) and issubclass(kind, Rows)
            joined[name] = kind.join(values) if is_rows else np.concatenate(values)
        return cls(**joined)

    def take(self, rows: Index) -> Self:
        """A copy of some rows."""
        taken: dict[str, Any] = {}
        for name in _names(type(self)):
            values = getattr(self, name)
            taken[name] = values.take(rows) if isinstance(values, Rows) else values.take(rows, 0)
        return type(self)(**taken)

    def put(self, rows: Index, source: Self) -> None:
        """Overwrite some rows with `source`, which has as many."""
        for name in _names(type(self)):
            values = getattr(self, name)
            if isinstance(values, Rows):
                values.put(rows, getattr(source, name))
            else:
                values[rows] = getattr(source, name)

    def grow(self, rows: int) -> None:
        """Append zeroed rows until there are `rows`."""
        for name in _names(type(self)):
            values = getattr(self, name)
            if isinstance(values, Rows):
                values.grow(rows)
            else:
                more = np.zeros((rows - len(values), *values.shape[1:]), values.dtype)
                setattr(self, name, np.concatenate([values, more]))


def flat_columns(rows: type[Rows], path: str = "") -> Iterator[Column]:
    """The arrays of a class, those of columns within columns included, in order."""
    for name, kind, shape in _columns(rows):
        if isinstance(kind, type) and issubclass(kind, Rows):
            yield from flat_columns(kind, f"{path}{name}.")
        else:
            yield Column(path + name, np.dtype(kind), shape)


def _names(rows: type) -> list[str]:
    return [name for name, *_ in _columns(rows)]


def _columns(rows: type) -> tuple[tuple[str, Any, tuple[int, ...]], ...]:
    """Name, dtype or `Rows` class, and row shape of each column of a class."""
    return _read_columns(rows)


@cache  # reading the hints takes longer than most work on rows
def _read_columns(rows: type) -> tuple[tuple[str, Any, tuple[int, ...]], ...]:
    hints = get_type_hints(rows, include_extras=True)
    return tuple((name, *_column(hint)) for name, hint in hints.items())


def _column(hint: Any) -> tuple[Any, tuple[int, ...]]:
    if get_origin(hint) is Annotated:
        array, shape = get_args(hint)
        return _column(array)[0], shape.sizes
    if isinstance(hint, type):
        return hint, ()
    return get_args(get_args(hint)[1])[0], ()  # NDArray[T] is ndarray[shape, dtype[T]]
