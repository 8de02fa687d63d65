"""PLY, ASCII and binary: positions and faces. Everything else in the file is skipped."""

from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.meshes.faces import bad, check_count, corners_of, fan
from wayfarer.navigation.scene_spec import MAX_TRIANGLES

_TYPES: Final = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS: Final = {"binary_little_endian": "<", "binary_big_endian": ">"}
_FACE_LISTS: Final = ("vertex_indices", "vertex_index")
_MAX_HEADER: Final = 64 * 1024
_MAX_ROWS: Final = 3 * MAX_TRIANGLES
_MAX_CELLS: Final = 12 * MAX_TRIANGLES


@dataclass(slots=True)
class _Element:
    """One table of the file. `columns`: name → (type of the length of a list or "", type)."""

    name: str
    count: int
    columns: dict[str, tuple[str, str]] = field(default_factory=dict)


def read_ply(data: bytes) -> NDArray[np.float64]:
    """Corners [T, 3, 3] as the file has them. Raises InvalidArgument."""
    end = data.find(b"end_header", 0, _MAX_HEADER)
    if not data.startswith(b"ply") or end < 0:
        raise bad("a PLY file starts with `ply` and a header that ends with `end_header`")
    form, elements = _header(data[:end].decode("ascii", "replace").splitlines())
    body = data[data.find(b"\n", end) + 1 :]
    cells = _Text(body) if form == "ascii" else _Binary(body, _ORDERS[form])
    vertices, faces, start = None, None, 0
    for element in elements:
        places, sizes, start = _walk(element, cells, start)
        if element.name == "vertex":
            vertices = np.stack([_column(element, places, cells, axis) for axis in "xyz"], -1)
        elif element.name == "face":
            faces = _faces(element, places, sizes, cells)
    if vertices is None or faces is None:
        raise bad("a PLY mesh has the elements `vertex` and `face`")
    return corners_of(vertices, faces)


class _Text:
    """The body of an ASCII file: every number is one cell."""

    def __init__(self, body: bytes) -> None:
        try:
            self._numbers = np.array(body.split(), np.float64)
        except ValueError as error:
            raise bad(f"the ASCII body is not all numbers: {error}") from None

    def width(self, kind: str) -> int:
        return 1

    def length(self, at: int, kind: str) -> int:
        value = self._numbers[at]
        if not value.is_integer():  # false for a NaN, too
            raise bad(f"a list of length {value:g}")
        return int(value)

    def take(self, places: NDArray[np.int64], kind: str) -> NDArray[np.float64]:
        return self._numbers[places]


class _Binary:
    """The body of a binary file: a cell is a byte."""

    def __init__(self, body: bytes, order: str) -> None:
        self._bytes = np.frombuffer(body, np.uint8)
        self._body = body
        self._order = order
        self._byteorder: Literal["little", "big"] = "little" if order == "<" else "big"

    def width(self, kind: str) -> int:
        return int(kind[1])

    def length(self, at: int, kind: str) -> int:
        raw = self._body[at : at + self.width(kind)]
        if len(raw) < self.width(kind):
            raise IndexError
        return int.from_bytes(raw, self._byteorder, signed=kind[0] == "i")

    def take(self, places: NDArray[np.int64], kind: str) -> NDArray[np.float64]:
        cells = self._bytes[places[..., None] + np.arange(self.width(kind))]
        values = cells.reshape(-1).view(self._order + kind).reshape(places.shape)
        return values.astype(np.float64)


def _header(lines: list[str]) -> tuple[str, list[_Element]]:
    """("ascii" or a key of _ORDERS, the elements in their order in the file)."""
    form, elements = "", list[_Element]()
    for line in lines[1:]:
        match line.split():
            case ["format", name, "1.0"] if name == "ascii" or name in _ORDERS:
                form = name
            case ["element", name, count] if count.isdecimal() and len(count) < 10:
                elements.append(_Element(name, check_count(int(count), name, _MAX_ROWS)))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].columns[name] = ("", _TYPES[kind])
            case ["property", "list", size, kind, name] if (
                elements and kind in _TYPES and _TYPES.get(size, "f")[0] != "f"
            ):
                elements[-1].columns[name] = (_TYPES[size], _TYPES[kind])
            case ["comment" | "obj_info", *_] | []:
                pass
            case _:
                raise bad(f"PLY header line {line[:60]!r} is not understood")
    if not form:
        raise bad("the PLY header names no format")
    return form, elements


_Places: TypeAlias = tuple[dict[str, NDArray[np.int64]], dict[str, NDArray[np.int64]], int]
"""Places of each column's cells, lengths of its lists, and the start of the next element."""


def _walk(element: _Element, cells: _Text | _Binary, start: int) -> _Places:
    """The places of an element whose body begins at `start`."""
    if not element.count:
        none = dict.fromkeys(element.columns, np.empty(0, np.int64))
        return none, none, start
    try:
        return _even(element, cells, start) or _uneven(element, cells, start)
    except IndexError:
        raise bad(f"the file ends within element {element.name}") from None


def _even(element: _Element, cells: _Text | _Binary, start: int) -> _Places | None:
    """The places if all rows have lists as long as the first row's, as triangles do."""
    first, lengths, stride = _row(element, cells, start)
    steps = np.arange(element.count) * stride
    for name, length in lengths.items():
        size, _ = element.columns[name]
        try:
            found = cells.take(start + steps + first[name] - cells.width(size), size)
        except IndexError:  # rows are shorter than the first
            return None
        if (found != length).any():
            return None
    places = {name: start + steps + offset for name, offset in first.items()}
    every = {name: np.full(element.count, length) for name, length in lengths.items()}
    return places, every, start + element.count * stride


def _uneven(element: _Element, cells: _Text | _Binary, start: int) -> _Places:
    """The places, found row by row."""
    check_count(element.count * len(element.columns), "cells with lists among them", _MAX_CELLS)
    found: dict[str, list[int]] = {name: [] for name in element.columns}
    sizes: dict[str, list[int]] = {name: [] for name in element.columns}
    at = start
    for _ in range(element.count):
        offsets, lengths, stride = _row(element, cells, at)
        for name, offset in offsets.items():
            found[name].append(at + offset)
        for name, length in lengths.items():
            sizes[name].append(length)
        at += stride
    return _arrays(found), _arrays(sizes), at


def _row(
    element: _Element, cells: _Text | _Binary, start: int
) -> tuple[dict[str, int], dict[str, int], int]:
    """The row at `start`: the offset of each column's cells, the lengths of its lists, and the
    row's length.
    """
    offsets, lengths, at = dict[str, int](), dict[str, int](), start
    for name, (size, kind) in element.columns.items():
        if size:
            lengths[name] = check_count(cells.length(at, size), f"items in a list of {name}")
            at += cells.width(size)
        offsets[name] = at - start
        at += cells.width(kind) * lengths.get(name, 1)
    return offsets, lengths, at - start


def _arrays(lists: dict[str, list[int]]) -> dict[str, NDArray[np.int64]]:
    return {name: np.array(values, np.int64) for name, values in lists.items()}


def _column(
    element: _Element, places: dict[str, NDArray[np.int64]], cells: _Text | _Binary, name: str
) -> NDArray[np.float64]:
    """A column of plain numbers. [rows]"""
    size, kind = element.columns.get(name, ("", ""))
    if not kind or size:
        raise bad(f"element {element.name} has no plain property {name}")
    try:
        return cells.take(places[name], kind)
    except IndexError:
        raise bad(f"the file ends within element {element.name}") from None


def _faces(
    element: _Element,
    places: dict[str, NDArray[np.int64]],
    sizes: dict[str, NDArray[np.int64]],
    cells: _Text | _Binary,
) -> NDArray[np.int64]:
    """Triangles [T, 3] of the lists of vertex indices."""
    name = next((n for n in _FACE_LISTS if element.columns.get(n, ("", ""))[0]), None)
    if name is None:
        raise bad(f"element face has no list named {' or '.join(_FACE_LISTS)}")
    kind, lengths = element.columns[name][1], sizes[name]
    check_count(int(lengths.sum()), "corners of faces", _MAX_ROWS)
    turn = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    try:
        indices = cells.take(np.repeat(places[name], lengths) + turn * cells.width(kind), kind)
    except IndexError:
        raise bad("the file ends within element face") from None
    return fan(np.nan_to_num(indices, nan=-1, posinf=-1, neginf=-1).astype(np.int64), lengths)
