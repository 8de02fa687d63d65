"""The one table of coordinate bases, and conversion between the core's basis and each of them.

Core: metres, right-handed, Z up; a body at heading 0 faces +Y, and its right side is +X.
A basis is a signed permutation M of the core's axes and a unit of length: p' = M p / unit.
If M turns a right-handed frame into a left-handed one (det M = -1), rotations change direction: the
vector part of a quaternion is a pseudovector, v' = det(M) M v, and an angle about the up axis
changes its sign.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]


class Basis(StrEnum):
    """The bases that a session can choose."""

    GLTF = "gltf"
    UNITY = "unity"
    UNREAL = "unreal"
    UNREAL_MANNEQUIN = "unreal_mannequin"
    BLENDER = "blender"
    ROS = "ros"

    @property
    def axes(self) -> "Axes":
        """The axes of this basis in terms of the core's."""
        return TABLE[self]


@dataclass(frozen=True)
class Axes:
    """Each axis of a basis as a signed core axis, and its unit of length."""

    core_axes: tuple[str, str, str]  # ("-x", "+z", "+y"): x is core -x, y is core z, z is core y
    metres_per_unit: float = 1.0

    @cached_property
    def matrix(self) -> Array:
        """M [3, 3]."""
        rows = np.zeros((3, 3))
        for row, axis in zip(rows, self.core_axes, strict=True):
            row["xyz".index(axis[1])] = -1.0 if axis[0] == "-" else 1.0
        return rows

    @cached_property
    def handedness(self) -> float:
        """det(M): 1 if right-handed like the core, -1 if left-handed."""
        return float(round(np.linalg.det(self.matrix)))

    @cached_property
    def quaternion_matrix(self) -> Array:
        """The map [4, 4] of quaternions x, y, z, w; orthogonal, so its inverse is its transpose."""
        block = np.eye(4)
        block[:3, :3] = self.handedness * self.matrix
        return block

    @cached_property
    def _point_columns(self) -> tuple[tuple[int, float], ...]:
        return _columns(self.matrix / self.metres_per_unit)

    @cached_property
    def quaternion_parts(self) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """For x, y, z, w of this basis: indices of the core's components [4], and signs [4]."""
        sources, signs = zip(*_columns(self.quaternion_matrix), strict=True)
        return np.array(sources), np.array(signs, np.float32)

    @property
    def up(self) -> Array:
        """The core's +Z in this basis [3]."""
        return self.matrix @ (0.0, 0.0, 1.0)

    @property
    def forward(self) -> Array:
        """The core's +Y in this basis [3]: the direction that a body faces at heading 0."""
        return self.matrix @ (0.0, 1.0, 0.0)

    def points_to_wire(self, points: Array, out: Array | None = None) -> Array:
        """Core points or offsets [..., 3], metres → this basis and its unit; into `out`.

        It goes column by column, which is exact and faster than a product with so small a matrix.
        """
        out = np.empty_like(points) if out is None else out
        for column, (source, factor) in enumerate(self._point_columns):
            np.multiply(points[..., source], factor, out=out[..., column])
        return out

    def points_to_core(self, points: Array) -> Array:
        """The inverse of `points_to_wire`."""
        return points @ (self.matrix * self.metres_per_unit).astype(points.dtype)

    def heading_to_wire(self, heading: float) -> float:
        """Core heading → angle about this basis's up axis from its forward axis (own inverse)."""
        return self.handedness * heading

    heading_to_core = heading_to_wire

    def length_to_wire(self, metres: float) -> float:
        """Converts a length or speed in m or m/s to this basis's unit."""
        return metres / self.metres_per_unit

    def length_to_core(self, length: float) -> float:
        """The inverse of `length_to_wire`."""
        return length * self.metres_per_unit


def _columns(matrix: Array) -> tuple[tuple[int, float], ...]:
    """Column and factor of the only nonzero number in each row."""
    sources = np.abs(matrix).argmax(-1)
    return tuple((int(k), float(row[k])) for k, row in zip(sources, matrix, strict=True))


TABLE: Final = {
    Basis.GLTF: Axes(("-x", "+z", "+y")),
    Basis.UNITY: Axes(("+x", "+z", "+y")),
    Basis.UNREAL: Axes(("+y", "+x", "+z"), metres_per_unit=0.01),
    Basis.UNREAL_MANNEQUIN: Axes(("-x", "+y", "+z"), metres_per_unit=0.01),
    Basis.BLENDER: Axes(("-x", "-y", "+z")),
    Basis.ROS: Axes(("+y", "-x", "+z")),
}
