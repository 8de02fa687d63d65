"""Clothes as paint, with even hems: a body's triangles are cut where one garment ends.

The garment of each vertex is known. Without cuts a hem would follow the mesh's edges, in teeth.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel, largest_weights
from wayfarer.body.outfit import EYES, REGIONS, SKIN, regions

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

EVEN_M: Final = 0.03
"""A hem is smoothed over about this length, and at least over a few triangles."""

NEAREST: Final = 0.05
"""A cut keeps this share of an edge's length from its ends: no slivers."""

PIECES: Final = {
    (False, False, False): [(0, 1, 2)],
    (True, False, True): [(0, 3, 5), (1, 2, 5), (1, 5, 3)],
    (True, True, False): [(1, 4, 3), (0, 3, 4), (0, 4, 2)],
    (False, True, True): [(2, 5, 4), (0, 1, 4), (0, 4, 5)],
    (True, True, True): [(0, 3, 5), (1, 4, 3), (2, 5, 4), (3, 4, 5)],
}
"""Pieces of a triangle, by cut edges among 0-1, 1-2 and 2-0. Corners 0 to 2 are the triangle's, 3
to 5 the cuts of these edges. A piece wears what its first corner wears."""


@lru_cache(maxsize=16)
def painted(body: BodyModel) -> tuple[BodyModel, Index]:
    """The body with its triangles cut along the hems, and the region that each wears [F].

    Its vertices and texture coordinates are those of `body`, followed by those on the hems.
    """
    share = _evened(body)
    wears = share.argmax(-1)  # [V]
    eyes = (regions(body)[body.faces] == EYES).any(-1)
    worn = np.where(eyes[:, None], EYES, wears[body.faces])  # [F, 3]
    cut = worn != np.roll(worn, -1, axis=1)  # [F, 3] the edge from this corner to the next
    swap = body.faces[cut] > np.roll(body.faces, -1, axis=1)[cut]

    def in_order(faces: Index) -> Index:
        """The ends of all cut edges [C, 2], equal for the two triangles of an edge."""
        start, end = faces[cut], np.roll(faces, -1, axis=1)[cut]
        return np.stack([np.where(swap, end, start), np.where(swap, start, end)], -1)

    edges, number = np.unique(in_order(body.faces), axis=0, return_inverse=True)
    a, b = edges.T
    more, less = share[a, wears[a]] - share[a, wears[b]], share[b, wears[b]] - share[b, wears[a]]
    at = np.clip(more / np.maximum(more + less, 1e-12), NEAREST, 1 - NEAREST)  # from a to b
    triangles, slots = _pieces(cut)

    def pieces(faces: Index, count: int, number: Index) -> Index:
        six = np.concatenate([faces, np.zeros_like(faces)], axis=1)
        six[:, 3:][cut] = count + number
        return six[triangles[:, None], slots]

    uvs, uv_faces = body.uvs, body.uv_faces
    if uvs is not None and uv_faces is not None:
        uv_edges, first, uv_number = np.unique(
            in_order(uv_faces), axis=0, return_index=True, return_inverse=True
        )
        uv_faces = pieces(uv_faces, len(uvs), uv_number.reshape(-1))
        uvs = _with(uvs, uv_edges, at[number.reshape(-1)[first]])
    joints, weights = largest_weights(_with(_dense(body), edges, at)[len(wears) :])
    result = replace(
        body,
        bind_vertices=_with(body.bind_vertices, edges, at),
        bind_vertices_dirs=_with(body.bind_vertices_dirs, edges, at),
        pose_dirs=None if body.pose_dirs is None else _with(body.pose_dirs, edges, at),
        skin_joints=np.concatenate([body.skin_joints, joints]),
        skin_weights=np.concatenate([body.skin_weights, weights]),
        regions=np.concatenate([regions(body), wears[edges].max(-1)]).astype(np.uint8),
        faces=pieces(body.faces, len(wears), number.reshape(-1)),
        uvs=uvs,
        uv_faces=uv_faces,
    )
    six = np.concatenate([worn, np.repeat(worn.max(-1)[:, None], 3, axis=1)], axis=1)
    return result, six[triangles, slots[:, 0]]


def _evened(body: BodyModel) -> Array:
    """Share of each region around a vertex [V, regions]; eyes count as skin."""
    known = regions(body)
    share = np.eye(len(REGIONS))[np.where(known == EYES, SKIN, known)]
    ends = np.sort(np.stack([body.faces, np.roll(body.faces, -1, axis=1)], -1), axis=-1)
    a, b = np.unique(ends.reshape(-1, 2), axis=0).T
    places = body.bind_vertices
    hem = (share[a] != share[b]).any(-1)
    length = np.median(np.linalg.norm(places[a] - places[b], axis=-1)[hem]) if hem.any() else EVEN_M
    count = np.bincount(np.concatenate([a, b]), minlength=len(known))[:, None]
    for _ in range(max(4, round(2 * (EVEN_M / length) ** 2))):
        around = np.zeros_like(share)
        np.add.at(around, a, share[b])
        np.add.at(around, b, share[a])
        share = (share + around / np.maximum(count, 1)) / 2
    return share


def _pieces(cut: NDArray[np.bool_]) -> tuple[Index, Index]:
    """The triangle of each piece [P], and the piece's corners 0 to 5 there [P, 3]."""
    found = []
    for pattern, pieces in PIECES.items():
        mine = np.flatnonzero((cut == pattern).all(-1))
        found += [(mine, np.tile(piece, (len(mine), 1))) for piece in pieces]
    triangles, slots = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(triangles, kind="stable")
    return triangles[order], slots[order]


def _with(values: Array, edges: Index, at: Array) -> Array:
    """Values of vertices [V, …], followed by values at a share of the way along edges [E, 2]."""
    at = at.reshape(-1, *[1] * (values.ndim - 1))
    return np.concatenate([values, (1 - at) * values[edges[:, 0]] + at * values[edges[:, 1]]])


def _dense(body: BodyModel) -> Array:
    """Weights of all joints [V, J]."""
    dense = np.zeros((len(body.bind_vertices), len(body.joint_names)))
    np.add.at(dense, (np.arange(len(dense))[:, None], body.skin_joints), body.skin_weights)
    return dense
