"""Small operations on triangle meshes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]


def vertex_normals(vertices: Array, faces: Index) -> Array:
    """Smooth unit normals [V, 3], area weighted; faces are counter-clockwise from outside."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    facing = np.cross(b - a, c - a)
    normals = np.zeros((len(vertices), 3))
    for corner in range(3):
        np.add.at(normals, faces[:, corner], facing)
    return normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)


def split_vertices(faces: Index, *marks: Index) -> tuple[Index, list[Index], Index]:
    """Double the vertices where marks of their corners differ: colours, texture coordinates.

    `marks` [F, 3], numbers from 0, belong to the corners of faces [F, 3]. Returns the source vertex
    of each new vertex [V'], its marks [V'] each, and the faces [F, 3] over new vertices.
    """
    key = faces.astype(np.int64)
    for values in marks:
        key = key * (int(values.max()) + 1) + values
    _, first, corners = np.unique(key, return_index=True, return_inverse=True)
    marked = [values.reshape(-1)[first] for values in marks]
    return faces.reshape(-1)[first], marked, corners.reshape(faces.shape).astype(np.int64)
