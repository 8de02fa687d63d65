"""Struct of arrays: columns of equal length that are read and written by row.

The annotations declare the columns, by the types below:

    class Goals(Rows):
        given: Flags                            # [N]
        position: Annotated[Float, Shape(3)]    # [N, 3]
        history: OtherRows                      # columns within columns

To a type checker a column has the array's type. The dtype is given separately, since numpy's
releases differ in the structure of `NDArray`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from operator import attrgetter
from typing import Annotated, Any, Final, NamedTuple, Self, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

Flags = Annotated[NDArray[np.bool_], np.dtype(np.bool_)]
Float = Annotated[NDArray[np.float32], np.dtype(np.float32)]
Double = Annotated[NDArray[np.float64], np.dtype(np.float64)]
Int = Annotated[NDArray[np.int64], np.dtype(np.int64)]
Int8 = Annotated[NDArray[np.int8], np.dtype(np.int8)]
Int16 = Annotated[NDArray[np.int16], np.dtype(np.int16)]
UInt8 = Annotated[NDArray[np.uint8], np.dtype(np.uint8)]
UInt64 = Annotated[NDArray[np.uint64], np.dtype(np.uint64)]
Object = Annotated[NDArray[np.object_], np.dtype(np.object_)]

Array = NDArray[np.floating[Any]]
"""Numbers of single or double precision."""

Index = NDArray[np.int64]
"""Row numbers."""

Named = TypeVar("Named", bound=tuple[Any, ...])


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

    def take(self, rows: Index, axis: int = 0) -> Self:
        """A copy of some rows; `axis` is 0, as for the arrays."""
        return type(self)(*[values.take(rows, axis) for values in _values(type(self))(self)])

    def part(self, first: int, last: int) -> Self:
        """The rows from `first` to before `last`, of the same arrays."""
        return type(self)(
            *[
                values.part(first, last) if isinstance(values, Rows) else values[first:last]
                for values in _values(type(self))(self)
            ]
        )

    def put(self, rows: Index, source: Self) -> None:
        """Overwrites some rows with `source`, which has the same number."""
        self[rows] = source

    def __setitem__(self, rows: Index, source: Self) -> None:
        read = _values(type(self))
        for values, given in zip(read(self), read(source), strict=True):
            values[rows] = given

    def grow(self, rows: int) -> None:
        """Appends zeroed rows until there are `rows`."""
        for name, *_ in _columns(type(self)):
            values = getattr(self, name)
            if isinstance(values, Rows):
                values.grow(rows)
            else:
                more = np.zeros((rows - len(values), *values.shape[1:]), values.dtype)
                setattr(self, name, np.concatenate([values, more]))


def columns(kind: type[Named], rows: Rows) -> Named:
    """Some columns, named by `kind`, as a tuple that compiled rules take."""
    return kind(*map(np.ascontiguousarray, _values(kind)(rows)))


def _flatten(rows: type) -> tuple[Column, ...]:
    """The arrays of a class, including nested columns, in order."""
    found = list[Column]()
    for name, kind, shape in _columns(rows):
        if isinstance(kind, type) and issubclass(kind, Rows):
            found += [one._replace(path=f"{name}.{one.path}") for one in flat_columns(kind)]
        else:
            found.append(Column(name, np.dtype(kind), shape))
    return tuple(found)


flat_columns: Final[Callable[[type], tuple[Column, ...]]] = cache(_flatten)


def _reader(kind: type) -> Callable[[Rows], tuple[Any, ...]]:
    """Reads the columns, or nested column sets, that a class declares: at least two."""
    return attrgetter(*kind.__annotations__)


_values: Final[Callable[[type], Callable[[Rows], tuple[Any, ...]]]] = cache(_reader)


def _read_columns(rows: type) -> tuple[tuple[str, Any, tuple[int, ...]], ...]:
    """Name, dtype or `Rows` class, and row shape of each column of a class."""
    hints = get_type_hints(rows, include_extras=True)
    return tuple((name, *_column(rows, name, hint)) for name, hint in hints.items())


_columns: Final[Callable[[type], tuple[tuple[str, Any, tuple[int, ...]], ...]]] = cache(
    _read_columns
)  # reading the hints takes longer than most work on rows


def _column(rows: type, name: str, hint: Any) -> tuple[Any, tuple[int, ...]]:
    if isinstance(hint, type) and issubclass(hint, Rows):
        return hint, ()
    notes = getattr(hint, "__metadata__", ())  # of `Annotated`; nested ones are flat here
    kinds = [note for note in notes if isinstance(note, np.dtype)]
    if len(kinds) != 1:
        raise TypeError(
            f"{rows.__name__}.{name} is no column: annotate it with a column type of {__name__}, "
            f"as in `Float` or `Annotated[Float, Shape(3)]`, or a class of `Rows`; it has {hint}"
        )
    shapes = [note.sizes for note in notes if isinstance(note, Shape)]
    return kinds[0], shapes[0] if shapes else ()
