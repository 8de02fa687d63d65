"""The surface beneath a garment: removed if it cannot be seen, and drawn in at the garment's edge.

A vertex is covered if every direction that it faces meets the garment. Covered vertices are
removed, except for a margin along the visible ones. The margin lies below the garment, deeper the
farther in, and moves with the garment, so that nothing comes through in any pose.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from wayfarer.body.mesh import vertex_normals
from wayfarer.body.model import largest_weights

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

MARGIN_M: Final = 0.03
"""Metres along the surface, from what can be seen, that are kept beneath a garment."""

DEEP_M: Final = {"high": (0.002, 0.008), "low": (0.005, 0.016)}
"""Metres below a garment at its edge and at the margin's end, by detail: faces cut corners."""

MAX_SHIFT_M: Final = 0.05
"""Metres that a vertex is moved at most."""

OUTSIDE_M: Final = 0.03
"""Metres outside a garment up to which a vertex counts as covered: it comes through."""

LOOSE_M: Final = 0.08
"""Metres from what is beneath up to which cloth covers it."""

TILT: Final = np.radians(35.0)
"""Number of directions around the normal in which a garment is looked for."""

HANGING_TILT, HANGING_M, HANGING_LOOSE_M = np.radians(8.0), 0.015, 0.25
"""As TILT, MARGIN_M and LOOSE_M, for what hangs around both legs."""

CLEARANCE_M: Final = {"high": 0.003, "low": 0.006}
"""Metres that cloth keeps from what it is over, by detail."""

FOLD_M, ALONG = 0.015, 0.6
"""Metres between a fold and what covers it, and the cosine between their normals either way."""

FINER, HEM_M = 2, 0.004
"""How often the faces of a cover are quartered to find what is next to them, and metres from its
border that are not its middle."""

SPREAD: Final = 6
"""Rounds in which neighbours of cloth that is lifted follow it."""

NOTHING: Final = np.zeros(0, np.int64)

CLOSE_M, APART_M = 0.015, 0.06
"""Metres from the skin up to which cloth moves as it does, and from which as it would itself."""


@dataclass(frozen=True)
class Surface:
    """A mesh, in every gender that wears it."""

    vertices: Mapping[str, Array]  # by gender [V, 3]
    faces: Index  # [F, 3]
    weights: Array  # dense, [V, J]

    @property
    def mean(self) -> Array:
        """Mean of the genders [V, 3]."""
        return np.asarray(np.mean([*self.vertices.values()], axis=0))

    def of_faces(self, kept: Mask) -> "Surface":
        """The surface with only these faces [F], and all vertices."""
        return replace(self, faces=self.faces[kept])


@dataclass(frozen=True)
class Beneath:
    """The result for the V vertices of a surface under another one."""

    hidden: Mask  # [V] faces of such vertices alone are left out
    tucked: Mask  # [V] covered, and not left out
    shifts: Array  # [V, 3] metres by which it moves inwards, 0 where it is not tucked
    weights: Array  # [V, J] with which it moves then


def beneath(
    inner: Surface, cover: Surface, detail: str, listed: Index = NOTHING, hangs: bool = False
) -> Beneath:
    """What becomes of `inner`, the body, under `cover`; both have the same genders, or the cover
    fewer.

    `listed`: vertices that are known to be covered. `hangs`: the cover is far from the skin with a
    wide hem, so vertices that are visible from below are removed, too.
    """
    loose = HANGING_LOOSE_M if hangs else LOOSE_M
    tilt, margin = (HANGING_TILT, HANGING_M) if hangs else (TILT, MARGIN_M)
    return _beneath(inner, cover, detail, (loose, tilt, margin), listed, lined=True)


def between(inner: Surface, cover: Surface, detail: str) -> Beneath:
    """As `beneath`, of cloth or shoes under other cloth: they have folds and linings, whose normals
    point anywhere, so that what is close to the middle of the cover is covered, too.
    """
    from trimesh.remesh import subdivide

    shell, faces = cover.mean, cover.faces
    for _ in range(FINER):
        shell, faces = subdivide(shell, faces)
    edges = np.sort(np.concatenate([faces[:, :2], faces[:, 1:], faces[:, ::2]]))
    found, count = np.unique(edges, axis=0, return_counts=True)
    border = np.zeros(len(shell), bool)
    border[found[count == 1]] = True
    used = np.unique(faces)
    far = distances(shell, faces, border)[used] > HEM_M
    distance, near = KDTree(shell[used]).query(inner.mean)
    facing = vertex_normals(shell, faces)[used]
    along = np.abs((vertex_normals(inner.mean, inner.faces) * facing[near]).sum(-1))
    listed = np.flatnonzero((distance < FOLD_M) & far[near] & (along > ALONG))
    result = _beneath(inner, cover, detail, (LOOSE_M, TILT, MARGIN_M), listed)
    folds = listed[result.tucked[listed] & ~result.shifts[listed].any(-1)]
    inwards = -facing[near[folds]]
    under = ((inner.mean[folds] - shell[used[near[folds]]]) * inwards).sum(-1)
    depth = (DEEP_M[detail][1] - under).clip(0.0, MAX_SHIFT_M)
    result.shifts[folds] = depth[:, None] * inwards
    return result


def _beneath(
    inner: Surface,
    cover: Surface,
    detail: str,
    reach: tuple[float, float, float],
    listed: Index,
    lined: bool = False,
) -> Beneath:
    """`reach`: metres of LOOSE_M, angle of TILT, metres of MARGIN_M. `lined`: a cover that is met
    from its wrong side covers, too.
    """
    loose, tilt, margin = reach
    covered = np.ones(len(inner.weights), bool)
    gaps, moved = np.full(len(covered), np.inf), np.zeros_like(inner.weights)
    facing = np.zeros((len(covered), 3))
    for gender, shell in cover.vertices.items():
        skin = inner.vertices[gender]
        normals = vertex_normals(skin, inner.faces)
        rays = _Rays(shell, cover.faces, OUTSIDE_M, loose, lined)
        met, gap, face, shares = rays.around(skin, normals, tilt)
        covered &= met
        gaps = np.minimum(gaps, gap)
        at = np.einsum("vk,vkj->vj", shares, cover.weights[cover.faces[face]])
        moved += np.where(np.isfinite(gap)[:, None], at, inner.weights) / len(cover.vertices)
        facing += normals / len(cover.vertices)
    used = np.zeros(len(covered), bool)
    used[inner.faces] = True
    covered[listed] = True
    covered &= used
    away = distances(inner.mean, inner.faces, used & ~covered)
    hidden = covered & (away > margin)
    tucked = np.zeros(len(covered), bool)
    tucked[inner.faces[~hidden[inner.faces].all(-1)]] = True
    tucked &= covered
    inside = np.clip(away / margin, 0.0, 1.0)
    least, most = DEEP_M[detail]
    wanted = least + (most - least) * inside
    depths = np.where(tucked, np.clip(wanted - np.minimum(gaps, wanted), 0.0, MAX_SHIFT_M), 0.0)
    share = np.where(tucked, inside, 0.0)[:, None]
    weights = (1 - share) * inner.weights + share * moved
    return Beneath(hidden, tucked, -depths[:, None] * facing, weights)


def distances(vertices: Array, faces: Index, start: Mask) -> Array:
    """Metres along edges from the vertices `start` [V] to each [V]; inf where there is no way."""
    if not start.any():
        return np.full(len(vertices), np.inf)
    edges = np.unique(np.sort(np.concatenate([faces[:, :2], faces[:, 1:], faces[:, ::2]])), axis=0)
    lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=-1)
    graph = coo_array((np.maximum(lengths, 1e-9), edges.T), (len(vertices),) * 2).tocsr()
    return np.asarray(dijkstra(graph, directed=False, indices=np.flatnonzero(start), min_only=True))


def conformed(outer: Surface, inner: Surface) -> Array:
    """Weights [V, J] with which cloth moves as what is close beneath it. `outer`'s own where it is
    far.
    """
    weights, gap = np.zeros_like(outer.weights), np.zeros(len(outer.weights))
    for gender, shell in outer.vertices.items():
        skin = inner.vertices[gender]
        used = np.unique(inner.faces)
        normals = vertex_normals(skin, inner.faces)[used]
        own = vertex_normals(shell, outer.faces)
        far, near = KDTree(skin[used]).query(shell, 12)
        along = np.einsum("vkc,vc->vk", normals[near], own)
        shares = np.where(along > 0.2, 1.0, 1e-3) / np.maximum(far, 1e-3) ** 2
        shares /= shares.sum(-1, keepdims=True)
        weights += np.einsum("vk,vkj->vj", shares, inner.weights[used[near]])
        gap += far[:, 0]
    weights, gap = weights / len(outer.vertices), gap / len(outer.vertices)
    like = np.clip((APART_M - gap) / (APART_M - CLOSE_M), 0.0, 1.0)[:, None]
    weights = like * weights + (1 - like) * outer.weights
    return smoothed(weights, outer.faces, 4)


def lifted(outer: Surface, inner: Surface, detail: str) -> Surface:
    """Cloth that is moved out of what it is over, where it lies in it by up to OUTSIDE_M."""
    moved = {}
    for gender, shell in outer.vertices.items():
        normals = smoothed(vertex_normals(shell, outer.faces), outer.faces, 3)
        normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
        rays = _Rays(inner.vertices[gender], inner.faces)
        enters, distance = rays.inwards(shell + OUTSIDE_M * normals, -normals)
        missing = CLEARANCE_M[detail] + OUTSIDE_M - distance
        lift = np.where(enters & (distance < 2 * OUTSIDE_M), missing, 0.0).clip(0.0)
        lift = lift[:, None]
        for _ in range(SPREAD):
            lift = np.maximum(lift, smoothed(lift, outer.faces, 1))
        moved[gender] = shell + lift * normals
    return replace(outer, vertices=moved)


def smoothed(values: Array, faces: Index, rounds: int) -> Array:
    """Values [V, ...] of vertices, each round the mean of a vertex and of its neighbours' mean."""
    edges = np.unique(np.sort(np.concatenate([faces[:, :2], faces[:, 1:], faces[:, ::2]])), axis=0)
    both = np.concatenate([edges, edges[:, ::-1]])
    graph = coo_array((np.ones(len(both)), both.T), (len(values),) * 2).tocsr()
    count = np.asarray(graph.sum(-1)).reshape(-1, 1)
    for _ in range(rounds):
        around = np.where(count > 0, graph @ values / np.maximum(count, 1), values)
        values = (values + around) / 2
    return values


def strongest(weights: Array) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Joints [V, 4] and weights [V, 4] of 255, as they are stored."""
    joints, kept = largest_weights(weights)
    return joints.astype(np.uint8), (255 * kept).round().astype(np.uint8)


class _Rays:
    """Rays from inside a garment."""

    def __init__(
        self,
        vertices: Array,
        faces: Index,
        outside: float = 0.0,
        loose: float = LOOSE_M,
        lined: bool = False,
    ) -> None:
        import trimesh
        from trimesh.ray.ray_pyembree import RayMeshIntersector

        self.mesh = trimesh.Trimesh(vertices, faces, process=False)
        self.rays = RayMeshIntersector(self.mesh)
        self.outside, self.loose = outside, outside + loose
        self.folded = 2 * outside if lined else 0.0

    def around(
        self, points: Array, normals: Array, tilt: float
    ) -> tuple[Mask, Array, Index, Array]:
        """Whether the garment is met along the normal and all around it; metres along the normal to
        it, less than 0 from outside, inf where it is not met; the face there, and the shares of its
        corners. [N], [N], [N], [N, 3].
        """
        across = np.cross(normals, np.eye(3)[np.abs(normals).argmin(-1)])
        across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-12)
        along = np.cross(normals, across)
        origins = points - self.outside * normals
        met, gap, face, shares = self._first(origins, normals)
        gap = np.where(met, gap, np.inf)
        for turn in np.arange(8) * np.pi / 4:
            side = np.cos(turn) * across + np.sin(turn) * along
            way = np.cos(tilt) * normals + np.sin(tilt) * side
            also, distance, other, parts = self._first(origins, way)
            nearer = also & (np.cos(tilt) * distance < gap)
            gap[nearer] = np.cos(tilt) * distance[nearer]
            face[nearer], shares[nearer] = other[nearer], parts[nearer]
            met &= also
        return met, gap - self.outside, face, shares

    def inwards(self, origins: Array, ways: Array) -> tuple[Mask, Array]:
        """Whether a mesh is met from outside, and the metres. [N], [N]."""
        _, distance, face, _ = self._first(origins, ways)
        return (self.mesh.face_normals[face] * ways).sum(-1) < 0, distance

    def _first(self, origins: Array, ways: Array) -> tuple[Mask, Array, Index, Array]:
        """Whether a garment is met from inside, the metres, the face, the shares of its corners."""
        import trimesh

        distance, found = np.full(len(origins), np.inf), np.zeros(len(origins), np.int64)
        shares = np.full((len(origins), 3), 1 / 3)
        face, ray, place = self.rays.intersects_id(
            origins, ways, multiple_hits=False, return_locations=True
        )
        distance[ray], found[ray] = np.linalg.norm(place - origins[ray], axis=-1), face
        weights = trimesh.triangles.points_to_barycentric(self.mesh.triangles[face], place)
        weights = np.nan_to_num(weights.clip(0, 1), nan=1 / 3)
        shares[ray] = weights / weights.sum(-1, keepdims=True)
        leaves = (self.mesh.face_normals[found] * ways).sum(-1) > 0
        met = np.where(leaves, distance < self.loose, distance < self.folded)
        return met, distance, found, shares
