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


def split_by_label(labels: Index, faces: Index) -> tuple[Index, Index, Index]:
    """Double the vertices that faces of different labels share, so that no face mixes labels.

    `labels` [F] is one per face. Returns for each new vertex the vertex it comes from [V'] and its
    label [V'], and the faces [F, 3] over the new vertices.
    """
    span = int(labels.max()) + 1
    pairs, corners = np.unique(faces * span + labels[:, None], return_inverse=True)
    return pairs // span, pairs % span, corners.reshape(faces.shape).astype(np.int64)
