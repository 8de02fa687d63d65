"""Wavefront OBJ: `v` and `f` lines. All others (materials, normals, groups) are skipped."""

import io
from collections.abc import Iterator
from itertools import chain
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.meshes.faces import bad, check_count, corners_of, fan
from wayfarer.navigation.scene_spec import MAX_TRIANGLES

_MOST: Final = 3 * MAX_TRIANGLES
"""Vertices, and corners of faces."""


def read_obj(data: bytes) -> NDArray[np.float64]:
    """Corners [T, 3, 3] as the file has them. Raises InvalidArgument, with the line."""
    vertices: list[list[float]] = []
    indices: list[int] = []
    sizes: list[int] = []
    for number, words in _lines(data):
        try:
            if words[:1] == [b"v"]:
                vertices.append([float(word) for word in words[1:4]])
                if len(vertices[-1]) != 3:
                    raise bad(f"line {number}: a vertex has three coordinates")
                check_count(len(vertices), "vertices", _MOST)
            elif words[:1] == [b"f"]:
                corners = [int(word.split(b"/")[0]) for word in words[1:]]
                # indices start at 1; negative ones count back from the latest vertex
                places = [c - 1 if c > 0 else len(vertices) + c if c else -1 for c in corners]
                if not all(0 <= place < _MOST for place in places):
                    raise bad(f"line {number}: {_text(words)} names a vertex beyond the file's")
                indices += places
                sizes.append(len(places))
                check_count(len(indices), "corners of faces", _MOST)
        except ValueError:
            raise bad(f"line {number}: {_text(words)} is not a list of numbers") from None
    faces = fan(np.array(indices, np.int64), np.array(sizes, np.int64))
    return corners_of(np.array(vertices, np.float64).reshape(-1, 3), faces)


def _lines(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """Number and words of each line, one by one; a backslash at its end continues it below."""
    lines = io.BytesIO(data if b"\n" in data else data.replace(b"\r", b"\n"))
    words: list[bytes] = []
    for number, line in enumerate(chain(lines, [b""]), 1):
        words += line.split()
        if words and words[-1].endswith(b"\\") and line:
            words[-1:] = [last] if (last := words[-1][:-1]) else []
            continue
        yield number, words
        words = []


def _text(words: list[bytes]) -> str:
    return repr(b" ".join(words[:8])[:60].decode("ascii", "replace"))
