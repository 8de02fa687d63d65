"""Shared by the readers."""

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.scene_spec import MAX_TRIANGLES


def bad(why: str) -> InvalidArgument:
    """The error of a reader."""
    return InvalidArgument(f"mesh.data: {why}", "mesh.data")


def check_count(count: int, what: str, most: int = MAX_TRIANGLES) -> int:
    """The count, if it is within bounds: nothing is allocated for a claim beyond them."""
    if not 0 <= count <= most:
        raise bad(f"{count:,} {what}, allowed are 0 to {most:,}")
    return count


def corners_of(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Corners [T, 3, 3] of faces [T, 3], whose indices are checked."""
    if len(faces) == 0:
        raise bad("no triangles")
    if faces.min() < 0 or faces.max() >= len(vertices):
        wrong = int(((faces < 0) | (faces >= len(vertices))).any(1).argmax())
        raise bad(f"triangle {wrong} names a vertex beyond the {len(vertices):,} that there are")
    return vertices[faces]


def fan(indices: NDArray[np.int64], sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Polygons, one after the other in `indices`, each of its size, → triangles [T, 3]."""
    if len(sizes) and sizes.min() < 3:
        raise bad("a face with fewer than 3 corners")
    first = np.repeat(np.cumsum(sizes) - sizes, sizes - 2)
    count = check_count(len(first), "triangles")
    turn = np.arange(count) - np.repeat(np.cumsum(sizes - 2) - (sizes - 2), sizes - 2)
    return indices[np.stack([first, first + turn + 1, first + turn + 2], -1)]
