"""The scipy functions of navigation. scipy is loaded with the first bake: with the server, it would
delay the start by a fifth of a second and take 40 MB.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]


def nearest_cell(marked: Mask) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Row and column of the nearest marked cell, for every cell of a grid; two grids."""
    from scipy.ndimage import distance_transform_edt

    row, column = distance_transform_edt(~marked, return_distances=False, return_indices=True)
    return row, column


def count_pieces(mask: Mask) -> int:
    """Groups of cells that touch along an edge."""
    from scipy.ndimage import label

    return int(label(mask)[1])


def labels(mask: Mask) -> NDArray[np.int32]:
    """The number of the group that each cell of a grid belongs to; 0: none."""
    from scipy.ndimage import label

    number: NDArray[np.int32] = label(mask)[0]
    return number


def links(size: int, one: NDArray[Any], other: NDArray[Any]) -> "csr_array":
    """The graph [size, size] of links from `one` to `other`."""
    from scipy.sparse import coo_array

    return coo_array((np.ones(len(one), bool), (one, other)), shape=(size, size)).tocsr()


def components(graph: "csr_array") -> tuple[int, Ints]:
    """How many connected components a graph has, and the number of each node's."""
    from scipy.sparse.csgraph import connected_components

    count, number = connected_components(graph, directed=False)
    return int(count), number.astype(np.int64)


def distances(points: NDArray[Any], others: NDArray[Any]) -> NDArray[np.float64]:
    """Distance from each point [n, 3] to the nearest of others [m, 3]. [n]"""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(others).query(points)[0], np.float64)
