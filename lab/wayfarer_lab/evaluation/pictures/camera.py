"""A pinhole camera: where it stands, and where a world point is in its picture."""

from dataclasses import dataclass
from functools import cached_property
from math import cos, sin, tan
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Size = tuple[int, int]
"""Width and height in pixels."""


@dataclass(frozen=True)
class View:
    """The direction of a camera, wherever it stands; distant parts are kept per view."""

    azimuth: float  # radians about +Z of the horizontal way it looks; 0 looks along +Y
    elevation: float  # radians above the horizon from which it looks down
    distance: float  # metres from its target
    metres: float  # height of the picture at the target
    size: Size

    @cached_property
    def axes(self) -> Array:
        """Unit rows in the world: the picture's right, its down, and the way ahead. [3, 3]."""
        a, e = self.azimuth, self.elevation
        right = np.array([cos(a), sin(a), 0.0])
        ahead = np.array([-sin(a) * cos(e), cos(a) * cos(e), -sin(e)])
        return np.stack([right, np.cross(ahead, right), ahead])

    @property
    def focal(self) -> float:
        """Pixels per unit of slope."""
        return self.size[1] * self.distance / self.metres

    @classmethod
    def wide(
        cls, azimuth: float, elevation: float, distance: float, angle: float, size: Size
    ) -> "View":
        """The view with a vertical opening angle (radians) instead of metres."""
        return cls(azimuth, elevation, distance, 2 * distance * tan(angle / 2), size)


@dataclass(frozen=True)
class Camera:
    """A view of a target: the world point [3] in the middle of the picture."""

    view: View
    target: tuple[float, float, float]

    @property
    def position(self) -> Array:
        """World place of the pinhole [3]."""
        return np.asarray(self.target) - self.view.distance * self.view.axes[2]

    def project(self, points: Array) -> Array:
        """World [..., 3] → column, row (pixels, row 0 on top), depth (metres ahead). [..., 3]."""
        seen = (points - self.position) @ self.view.axes.T
        depth = np.maximum(seen[..., 2:], 1e-6)
        middle = np.array(self.view.size) / 2
        return np.concatenate(
            [self.view.focal * seen[..., :2] / depth + middle, seen[..., 2:]], axis=-1
        )
