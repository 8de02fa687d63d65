"""Meshes with fewer faces, that say where on the finer one each vertex lies."""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from wayfarer_lab.baking.garments import connected
from wayfarer_lab.baking.texture import nearest

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

NEAR: Final = 40
"""Faces among which the one under a vertex of a coarser mesh is looked for."""


@dataclass(frozen=True)
class Coarse:
    """A mesh with fewer faces; each vertex V' lies on a face of the finer one."""

    faces: Index  # [F', 3]
    source: Index  # [F'] face of the finer mesh that each lies on
    corners: Index  # [V', 3] vertices of that mesh
    shares: Array  # [V', 3] of them, sum to 1


def alike(faces: Index, region: Index) -> Index:
    """A number for each face [F]: one for pieces with the same regions, so that layers differ."""
    piece = connected(faces)
    has = np.zeros((piece.max() + 1, region.max() + 1), bool)
    has[piece, region] = True
    return np.asarray(np.unique(has, axis=0, return_inverse=True)[1].reshape(-1)[piece])


def simplified(
    vertices: Array, faces: Index, most: int, hems: bool = True, group: Index | None = None
) -> Coarse:
    """A mesh of about `most` faces at most; the same mesh if it has no more. `hems`: they stay.

    Faces of different groups [F], which share no vertices, do not touch.
    """
    if group is None:
        group = np.zeros(len(faces), np.int64)
    parts = []
    for number in np.unique(group):
        mine = np.flatnonzero(group == number)
        part = _simplified(vertices, faces[mine], round(most * len(mine) / len(faces)), hems)
        parts.append(replace(part, source=mine[part.source]))
    starts = np.cumsum([0, *(len(part.corners) for part in parts)])
    return Coarse(
        np.concatenate([part.faces + at for part, at in zip(parts, starts, strict=False)]),
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("source", "corners", "shares")
        ),
    )


def _simplified(vertices: Array, faces: Index, most: int, hems: bool) -> Coarse:
    if len(faces) <= most:
        used, own = np.unique(faces, return_inverse=True)
        corners = np.repeat(used[:, None], 3, axis=1)
        shares = np.tile([1.0, 0.0, 0.0], (len(used), 1))
        return Coarse(own.reshape(faces.shape), np.arange(len(faces)), corners, shares)
    import pyfqmr

    mesh = pyfqmr.Simplify()
    mesh.setMesh(vertices, faces)
    mesh.simplify_mesh(target_count=most, aggressiveness=3, preserve_border=hems, verbose=False)
    points, found = (np.asarray(part) for part in mesh.getMesh()[:2])
    found = found.astype(np.int64)
    used, own = np.unique(found, return_inverse=True)
    found, points = own.reshape(-1, 3), points[used]
    triangles = vertices[faces]
    tree = KDTree(triangles.mean(1))

    def under(places: Array) -> tuple[Index, Array]:
        """The face under each place [N], and the corners' shares [N, 3]."""
        _, close = tree.query(places, min(NEAR, len(faces)))
        rows = [
            nearest(place[None], triangles[near])[1:]
            for place, near in zip(places, close, strict=True)
        ]
        face = np.array([near[row[0][0]] for row, near in zip(rows, close, strict=True)])
        return face, np.array([row[1][0] for row in rows])

    face, shares = under(points)
    middle, _ = under(points[found].mean(1))
    return Coarse(found, middle, faces[face], shares)
