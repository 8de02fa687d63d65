"""Transforms of glTF's nodes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def composed(translation: Array, rotation: Array, scale: Array) -> Array:
    """Matrices [n, 4, 4] of translations [n, 3], rotations x, y, z, w [n, 4] and scales [n, 3]."""
    x, y, z, w = rotation.T
    turned = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrices = np.tile(np.eye(4), (len(translation), 1, 1))
    matrices[:, :3, :3] = np.moveaxis(turned, -1, 0) * scale[:, None]
    matrices[:, :3, 3] = translation
    return matrices


def local(node: Mapping[str, Any]) -> Array:
    """A node's own transform. [4, 4]"""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    parts = (("translation", (0, 0, 0)), ("rotation", (0, 0, 0, 1)), ("scale", (1, 1, 1)))
    given = (np.array(node.get(name, usual), np.float64) for name, usual in parts)
    matrix: Array = composed(*(values.reshape(1, -1) for values in given))[0]
    return matrix


def placed(corners: Array, matrices: Array) -> Array:
    """Corners [T, 3, 3] at each of some transforms [n, 4, 4], one after the other. [n * T, 3, 3]"""
    found = (
        corners[None] @ matrices[:, None, :3, :3].swapaxes(-1, -2) + matrices[:, None, None, :3, 3]
    )
    # a mirroring transform turns its triangles over
    over = np.linalg.det(matrices[:, :3, :3]) < 0
    found[over] = found[over][:, :, ::-1]
    return found.reshape(-1, 3, 3)
