"""Orientation of a level's surfaces: which can be stood on, and whether it lies on its side."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import Text
from wayfarer.navigation.scene_spec import MeshAxes, Walkable

Array = NDArray[np.floating[Any]]

TIPPED: Final = 1.5
"""A level lies on its side when the surface across a horizontal axis is larger, by this factor,
than the level surface and than the surface across the other horizontal axis."""
_CURES: Final = {
    1: "if the file is Y up, send mesh.basis gltf",
    2: "if the file is Z up, send mesh.basis blender",
}
"""Advice, by the file's axis that seems to be up."""


def is_level(corners: Array, walkable: Walkable) -> NDArray[np.bool_]:
    """Whether triangles [T, 3, 3] are flat enough to stand on. [T]"""
    normals = _normals(corners)
    # either side may be the upper one: many files have inconsistent windings, and the underside of
    # a slab is no floor in any case, since the slab's top is too close above it
    steepest = np.cos(np.radians(walkable.slope_deg))
    found: NDArray[np.bool_] = np.abs(normals[:, 2]) >= steepest * np.linalg.norm(normals, axis=1)
    return found


def slopes(corners: Array) -> Array:
    """Slope of triangles [T, 3, 3], degrees, 0 to 90. [T]"""
    normals = _normals(corners)
    length = np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
    found: Array = np.degrees(np.arccos(np.minimum(np.abs(normals[:, 2]) / length, 1.0)))
    return found


def lies_on_its_side(corners: Array, walkable: Walkable, axes: MeshAxes) -> list[Text]:
    """Remarks on a level whose walls seem to be its floors; empty for all others."""
    normals = np.abs(_normals(corners))
    area = np.linalg.norm(normals, axis=1)
    steepest = np.cos(np.radians(walkable.slope_deg))
    across = [float(area[normals[:, k] >= steepest * area].sum()) for k in range(3)]
    up = int(np.argmax(across[:2]))
    if across[up] <= TIPPED * max(across[1 - up], across[2]):
        return []
    axis = int(np.abs(np.array(axes)[up]).argmax())
    cure = _CURES.get(axis, "turn it before it is exported")
    return [
        Text(
            f"the level seems to lie on its side: {across[up] / area.sum():.0%} of its surface is "
            f"upright and faces along the file's {'XYZ'[axis]} axis, and only "
            f"{across[2] / area.sum():.0%} is level; {cure}"
        )
    ]


def _normals(corners: Array) -> Array:
    """Normals [T, 3] as long as twice the area."""
    sides = corners[:, 1:] - corners[:, :1]
    found: Array = np.cross(sides[:, 0], sides[:, 1])
    return found
