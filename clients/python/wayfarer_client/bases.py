"""The bases a session may choose (docs/wire-format.md), as its clients need them."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from .quaternions import Array, rotate


@dataclass(frozen=True)
class Basis:
    """Unit vectors [3] of a body at heading 0, and the handedness of the axes."""

    left: Array
    up: Array
    forward: Array

    @property
    def handed(self) -> float:
        """1 when right-handed, -1 when left-handed."""
        return float(np.cross(self.left, self.up) @ self.forward)

    def heading(self, rotation: Array) -> float:
        """Angle about `up` by which a rotation [4] turns `forward`, radians."""
        ahead = rotate(rotation, self.forward)
        return float(np.arctan2(ahead @ np.cross(self.up, self.forward), ahead @ self.forward))

    def level(self, v: Array) -> Array:
        """The part of a vector [3] that lies along the ground."""
        return v - (v @ self.up) * self.up


def _basis(left: str, up: str, forward: str) -> Basis:
    def vector(axis: str) -> Array:
        return np.eye(3)["xyz".index(axis[1])] * (-1 if axis[0] == "-" else 1)

    return Basis(vector(left), vector(up), vector(forward))


BASES: Final = {
    "gltf": _basis("+x", "+y", "+z"),
    "unity": _basis("-x", "+y", "+z"),
    "unreal": _basis("-y", "+z", "+x"),
    "unreal_mannequin": _basis("+x", "+z", "+y"),
    "blender": _basis("+x", "+z", "-y"),
    "ros": _basis("+y", "+z", "+x"),
}
