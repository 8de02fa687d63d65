"""Posture: the tilt of the trunk."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.errors import InvalidArgument
from wayfarer.spec import BETAS

Array = NDArray[np.floating[Any]]

LEFT_WAIST = ("LFWT", "LBWT")
RIGHT_WAIST = ("RFWT", "RBWT")
CHEST = ("C7", "CLAV")


@dataclass(frozen=True)
class Trunk:
    """Which markers make a trunk, and which way it points when the body stands straight."""

    left_waist: list[int]
    right_waist: list[int]
    chest: list[int]
    rest: Array  # [3] unit vector waist → chest in the T-pose: right, forward, up

    @classmethod
    def of(cls, body: BodyModel, betas: Array | None = None) -> "Trunk":
        """The trunk of one shape [10]; without, of the mean body.

        Markers lie on the skin, so even the trunk of a T-pose leans a little; all tilts are
        relative to it. Raises InvalidArgument when the body lacks one of the markers.
        """
        left, right, chest = (_find(body, names) for names in (LEFT_WAIST, RIGHT_WAIST, CHEST))
        trunk = cls(left, right, chest, rest=np.zeros(3))
        shape = np.zeros(BETAS) if betas is None else betas
        return replace(trunk, rest=trunk.direction(body.rest_vertices(shape, body.marker_vertices)))

    def direction(self, markers: Array) -> Array:
        """Unit vector waist → chest of bodies [..., M, 3]: to the right, forward, up. [..., 3]

        Right is the horizontal direction from the left side of the waist to the right one.
        """
        left, right = (
            markers[..., sites, :].mean(-2) for sites in (self.left_waist, self.right_waist)
        )
        across = (right - left)[..., :2]
        x, y = np.moveaxis(across / np.linalg.norm(across, axis=-1, keepdims=True), -1, 0)
        up = markers[..., self.chest, :].mean(-2) - (left + right) / 2
        local = np.stack(
            [x * up[..., 0] + y * up[..., 1], x * up[..., 1] - y * up[..., 0], up[..., 2]], -1
        )
        return local / np.linalg.norm(local, axis=-1, keepdims=True)

    def tilt(self, markers: Array) -> Array:
        """Degrees between the trunk of bodies [..., M, 3], world space, and that of the T-pose.

        A lean to any side counts; a turn about the vertical does not. [...]
        """
        cosine = self.direction(markers) @ self.rest
        return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))

    def forward(self, markers: Array) -> Array:
        """Degrees that the trunk of bodies [..., M, 3] leans forward of that of the T-pose;
        negative: backward. [...]
        """
        now, rest = self.direction(markers), self.rest
        return np.degrees(np.arctan2(now[..., 1], now[..., 2]) - np.arctan2(rest[1], rest[2]))


def _find(body: BodyModel, names: tuple[str, ...]) -> list[int]:
    missing = [name for name in names if name not in body.marker_names]
    if missing:
        raise InvalidArgument(f"body {body.name} has no markers {missing}: no trunk can be seen")
    return [body.marker_names.index(name) for name in names]
