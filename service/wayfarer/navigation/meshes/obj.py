"""Wavefront OBJ: `v` and `f` lines; all others (materials, normals, groups) are passed over."""

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.meshes.faces import bad, check_count, corners_of, fan
from wayfarer.navigation.spec import MAX_TRIANGLES


def read_obj(data: bytes) -> NDArray[np.float64]:
    """Corners [T, 3, 3] as the file has them. Raises InvalidArgument, with the line."""
    vertices: list[list[float]] = []
    indices: list[int] = []
    sizes: list[int] = []
    for number, line in enumerate(data.splitlines(), 1):
        words = line.split()
        try:
            if words[:1] == [b"v"]:
                vertices.append([float(word) for word in words[1:4]])
                if len(vertices[-1]) != 3:
                    raise bad(f"line {number}: a vertex has three coordinates")
            elif words[:1] == [b"f"]:
                corners = [int(word.split(b"/")[0]) for word in words[1:]]
                # indices start at 1; negative ones count back from the latest vertex
                indices += [c - 1 if c > 0 else len(vertices) + c if c else -1 for c in corners]
                sizes.append(len(corners))
        except ValueError:
            raise bad(f"line {number}: {line[:60]!r} is not a list of numbers") from None
    check_count(len(vertices), "vertices", 3 * MAX_TRIANGLES)
    check_count(len(sizes), "faces")
    faces = fan(np.array(indices, np.int64), np.array(sizes, np.int64))
    return corners_of(np.array(vertices, np.float64).reshape(-1, 3), faces)
