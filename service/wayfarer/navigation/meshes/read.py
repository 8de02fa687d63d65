"""A mesh file → checked triangles in world space."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument, Metres
from wayfarer.navigation.meshes.glb import read_glb
from wayfarer.navigation.meshes.obj import read_obj
from wayfarer.navigation.meshes.ply import read_ply
from wayfarer.navigation.scene_spec import MAX_TRIANGLES, MeshFile, MeshFormat
from wayfarer.spec import MAX_COORDINATE

READERS: Final[dict[MeshFormat, Callable[[bytes], NDArray[np.float64]]]] = {
    "glb": read_glb,
    "obj": read_obj,
    "ply": read_ply,
}


def read_mesh(mesh: MeshFile) -> NDArray[np.float64]:
    """Corners [T, 3, 3] of the mesh's triangles, metres, Z up. Raises InvalidArgument.

    Triangles without an area are left out. Meshes need not be closed, oriented or manifold.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is caught below
        corners = READERS[mesh.format](mesh.data) @ (np.array(mesh.axes).T * mesh.unit)
    if len(corners) > MAX_TRIANGLES:
        raise InvalidArgument(
            f"the mesh has {len(corners):,} triangles, at most {MAX_TRIANGLES:,}", "mesh.data"
        )
    broken = ~(np.abs(corners) <= MAX_COORDINATE).all((1, 2))
    if broken.any():
        raise InvalidArgument(
            f"triangle {int(broken.argmax())} of the mesh has a corner that is not finite or lies "
            f"beyond {{}}: is mesh.unit ({mesh.unit:g} m) right?",
            "mesh.data",
            Metres(MAX_COORDINATE),
        )
    sides = corners[:, 1:] - corners[:, :1]
    kept = corners[np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=-1) > 1e-12]
    if len(kept) == 0:
        raise InvalidArgument("the mesh has no triangle with an area", "mesh.data")
    return kept
