"""A mesh file → checked triangles in world space."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument, Metres, Text
from wayfarer.navigation.meshes.glb import read_glb
from wayfarer.navigation.meshes.obj import read_obj
from wayfarer.navigation.meshes.outliers import without_outliers
from wayfarer.navigation.meshes.ply import read_ply
from wayfarer.navigation.meshes.posture import is_level, lies_on_its_side
from wayfarer.navigation.scene_spec import (
    MAX_TRIANGLES,
    MeshFile,
    MeshFormat,
    Point3,
    Walkable,
)
from wayfarer.spec import MAX_COORDINATE

FARTHEST: Final = 1e7
"""Metres: nothing farther away is measured. The remaining level must be much nearer."""

READERS: Final[dict[MeshFormat, Callable[[bytes], NDArray[np.float64]]]] = {
    "glb": read_glb,
    "obj": read_obj,
    "ply": read_ply,
}


def read_level(
    mesh: MeshFile, walkable: Walkable, entries: tuple[Point3, ...]
) -> tuple[NDArray[np.float64], list[Text]]:
    """Corners [T, 3, 3] of the triangles that belong to a level, metres, Z up, and remarks for its
    author. Raises InvalidArgument.

    Triangles without an area, domes and distant stray parts are left out, and the level may lie on
    its side. Meshes need not be closed, oriented or manifold.
    """
    corners = _read(mesh)
    kept, notes = without_outliers(corners, is_level(corners, walkable), entries)
    corners = corners[kept]
    _check_places(corners, mesh.unit)
    return corners, notes + lies_on_its_side(corners, walkable, mesh.axes)


def _read(mesh: MeshFile) -> NDArray[np.float64]:
    """Finite triangles with an area, wherever they are."""
    with np.errstate(over="ignore", invalid="ignore"):  # overflows are caught below
        corners = READERS[mesh.format](mesh.data) @ (np.array(mesh.axes).T * mesh.unit)
        if len(corners) > MAX_TRIANGLES:
            raise InvalidArgument(
                f"the mesh has {len(corners):,} triangles, at most {MAX_TRIANGLES:,}", "mesh.data"
            )
        broken = ~(np.abs(corners) <= FARTHEST).all((1, 2))
        if broken.any():
            raise InvalidArgument(
                f"triangle {int(broken.argmax())} of the mesh has a corner that is not finite",
                "mesh.data",
            )
        sides = corners[:, 1:] - corners[:, :1]
        kept = corners[np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=-1) > 1e-12]
    if len(kept) == 0:
        raise InvalidArgument("the mesh has no triangle with an area", "mesh.data")
    return kept


def _check_places(corners: NDArray[np.float64], unit: float) -> None:
    beyond = ~(np.abs(corners) <= MAX_COORDINATE).all((1, 2))
    if beyond.any():
        raise InvalidArgument(
            f"triangle {int(beyond.argmax())} of the mesh has a corner beyond {{}}: is mesh.unit "
            f"({unit:g} m) right?",
            "mesh.data",
            Metres(MAX_COORDINATE),
        )
