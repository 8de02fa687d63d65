"""Garments of MakeHuman (.mhclo and .obj), bound to its base mesh `hm08`. Build time only.

Each vertex of a garment lies at three vertices of the base mesh times weights, plus an offset that
grows with the body: a garment is linear in the base mesh, and so in the betas.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from wayfarer.errors import DataError

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

BASE_VERTICES: Final = 19_158
"""Vertices of hm08: the body, and helpers for clothes around it."""

FROM_MAKEHUMAN: Final = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
"""MakeHuman's axes (Y up, facing +Z) to ours (Z up, facing +Y)."""


@dataclass(frozen=True)
class BoundGarment:
    """V vertices bound to the base mesh, and faces [F, 3] over them, in one smooth surface."""

    name: str
    vertices: Index  # [V, 3] of the base mesh
    weights: Array  # [V, 3] sum to 1
    offsets: Array  # [V, 3] in MakeHuman's axes, in units of `scales`
    scales: tuple[tuple[int, int, float], ...]  # of x, y, z: two vertices, their distance at rest
    faces: Index  # [F, 3]
    islands: Index  # [F] number of the piece of the texture's layout, such as front or sleeve
    hides: Index  # vertices of the base mesh under it

    def place(self, base: Array) -> Array:
        """Its vertices on base meshes [19158, 3, …], metres and our axes. [V, 3, …].

        Linear in the base mesh as long as no two vertices of `scales` change sides; so it takes
        means, and directions of betas on the last axis with `like`, the mean.
        """
        return self.directions(base, base)

    def directions(self, base: Array, like: Array) -> Array:
        """As `place`, of a change of the base mesh `like` [19158, 3]."""
        placed = np.einsum("vk,vk...->v...", self.weights, base[self.vertices])
        for axis, (first, last, distance) in enumerate(self.scales):
            way = FROM_MAKEHUMAN[:, axis]  # the axis of MakeHuman in ours
            apart = np.tensordot(way, base[first] - base[last], axes=(0, 0))
            apart = apart * np.sign(way @ (like[first] - like[last])) / distance
            offset = np.multiply.outer(self.offsets[:, axis], way)
            placed = placed + np.multiply.outer(offset, apart)
        return np.asarray(placed)

    def of_faces(self, kept: NDArray[np.bool_]) -> "BoundGarment":
        """The garment with only these faces [F]."""
        return replace(self, faces=self.faces[kept], islands=self.islands[kept])

    def skin_weights(self, base: Array) -> Array:
        """Dense weights [V, J] from those [19158, J] of the vertices that it is bound to."""
        blended = np.einsum("vk,vkj->vj", self.weights, base[self.vertices]).clip(0.0)
        return np.asarray(blended / blended.sum(-1, keepdims=True))


def read_garment(path: Path) -> BoundGarment:
    """A `.mhclo` with the `.obj` that it names. Raises DataError where the file is not one."""
    settings, bound, hidden = _read_binding(path)
    if not bound:
        raise DataError("there are no bound vertices in it", str(path))
    if "obj_file" not in settings:
        raise DataError("it names no obj_file", str(path))
    single = np.array([[row[0]] * 3 if len(row) == 1 else row[:3] for row in bound])
    weights = [[1.0, 0.0, 0.0] if len(row) == 1 else row[3:6] for row in bound]
    offsets = [[0.0] * 3 if len(row) == 1 else row[6:9] for row in bound]
    count, faces, islands = read_obj(path.with_name(settings["obj_file"]))
    if count != len(bound):
        raise DataError(f"{len(bound)} vertices are bound, its mesh has {count}", str(path))
    vertices = single.astype(np.int64)
    if vertices.min() < 0 or vertices.max() >= BASE_VERTICES:
        raise DataError(f"a vertex is bound beyond the base mesh's {BASE_VERTICES}", str(path))
    return BoundGarment(
        name=path.stem,
        vertices=vertices,
        weights=np.array(weights),
        offsets=np.array(offsets),
        scales=tuple(_scale(settings, f"{axis}_scale", path) for axis in "xyz"),
        faces=faces,
        islands=islands,
        hides=np.array(sorted(hidden), dtype=np.int64),
    )


def read_obj(path: Path) -> tuple[int, Index, Index]:
    """The number of vertices of an OBJ file, its faces as triangles [F, 3], and their islands [F].

    An island is a piece of the layout of texture coordinates. Raises DataError.
    """
    count, corners = 0, []
    try:
        for line in path.read_text("utf-8").splitlines():
            kind, *words = line.split() or [""]
            if kind == "v":
                count += 1
            elif kind == "f":
                ring = [[int(number) - 1 for number in word.split("/")[:2]] for word in words]
                corners += [(ring[0], *pair) for pair in pairwise(ring[1:])]
        faces, layout = np.moveaxis(np.array(corners, dtype=np.int64).reshape(-1, 3, 2), -1, 0)
    except ValueError as error:
        raise DataError(f"not a mesh with texture coordinates: {error}", str(path)) from error
    if not len(faces) or faces.min() < 0 or faces.max() >= count or layout.min() < 0:
        raise DataError("it is not a mesh: faces are missing, or of vertices not there", str(path))
    return count, faces, connected(layout)


def connected(faces: Index) -> Index:
    """For each of faces [F, 3] the number of the piece that it belongs to, in their order. [F]."""
    count = int(faces.max()) + 1
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_array((np.ones(len(edges)), edges.T), (count, count))
    piece = connected_components(graph, directed=False)[1][faces[:, 0]]
    _, first, number = np.unique(piece, return_index=True, return_inverse=True)
    return np.asarray(first.argsort().argsort()[number])


def _read_binding(path: Path) -> tuple[dict[str, str], list[list[float]], set[int]]:
    """Settings, the numbers of each bound vertex, and the hidden vertices of the base mesh."""
    settings: dict[str, str] = {}
    bound: list[list[float]] = []
    hidden: set[int] = set()
    part = ""
    try:
        for line in path.read_text("utf-8").splitlines():
            words = line.split()
            if not words or words[0].startswith("#"):
                continue
            if words[0] in ("verts", "delete_verts"):
                part = words[0]
            elif part == "delete_verts":
                hidden.update(_ranges(words))
            elif part == "verts" and words[0].isdigit():
                bound.append(_numbers(words))
            else:
                settings[words[0]] = " ".join(words[1:])
    except ValueError as error:
        raise DataError(f"not a MakeHuman garment: {error}", str(path)) from error
    return settings, bound, hidden


def _numbers(words: list[str]) -> list[float]:
    if len(words) not in (1, 9):
        raise ValueError(f"a bound vertex has 1 or 9 numbers, not {len(words)}")
    return [float(word) for word in words]


def _ranges(words: list[str]) -> Iterable[int]:
    """Numbers, and ranges "a - b" with both ends."""
    numbers: list[int] = []
    until = False
    for word in words:
        if word == "-":
            until = True
        elif until:
            numbers += range(numbers[-1] + 1, int(word) + 1)
            until = False
        else:
            numbers.append(int(word))
    return numbers


def _scale(settings: dict[str, str], name: str, path: Path) -> tuple[int, int, float]:
    try:
        first, last, distance = settings[name].split()
        return int(first), int(last), float(distance)
    except (KeyError, ValueError) as error:
        raise DataError(f"{name} must be two vertices and their distance", str(path)) from error
