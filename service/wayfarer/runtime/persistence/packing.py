"""Column sets as bytes and back: each row a string of little-endian numbers, without a header.

The class alone decides the length of a row, so nothing that the bytes say is ever allocated.
"""

from math import prod
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument
from wayfarer.world.rows import Column, Rows, flat_columns

R = TypeVar("R", bound=Rows)


def row_bytes(kind: type[Rows]) -> int:
    """Length of one packed row."""
    return sum(_size(column) for column in flat_columns(kind))


def get(rows: Rows, path: str) -> NDArray[Any]:
    """The array that a path names."""
    array: NDArray[Any] = attrgetter(path)(rows)
    return array


def pack(rows: Rows) -> NDArray[np.uint8]:
    """Bytes [N, B] of N rows."""
    parts = []
    for column in flat_columns(type(rows)):
        values = np.ascontiguousarray(get(rows, column.path), column.dtype.newbyteorder("<"))
        parts.append(values.view(np.uint8).reshape(len(values), _size(column)))
    return np.concatenate(parts, axis=1)


def unpack(kind: type[R], data: bytes | memoryview, where: str) -> R:
    """As many rows as there are. `where` names them in messages.

    Raises InvalidArgument unless the rows are whole, flags are 0 or 1 and numbers are finite.
    """
    width = row_bytes(kind)
    if len(data) % width:
        raise InvalidArgument(f"{where} has {len(data)} bytes; a row has {width}", where)
    packed = np.frombuffer(data, np.uint8).reshape(-1, width)
    rows = kind.empty(len(packed))
    start = 0
    for column in flat_columns(kind):
        end = start + _size(column)
        stored = np.ascontiguousarray(packed[:, start:end])
        start = end
        if column.dtype == np.bool_ and (stored > 1).any():
            raise InvalidArgument(f"{where}.{column.path}: flags must be 0 or 1", where)
        values = stored.view(column.dtype.newbyteorder("<")).reshape(-1, *column.shape)
        if column.dtype.kind == "f" and not np.isfinite(values).all():
            raise InvalidArgument(f"{where}.{column.path} holds NaN or infinity", where)
        get(rows, column.path)[:] = values
    return rows


def _size(column: Column) -> int:
    return column.dtype.itemsize * prod(column.shape)
