"""Bodies moved in the plane, as rigid bodies. World space, metres."""

from typing import NamedTuple

import numpy as np

from wayfarer.world.output.quaternion import multiply
from wayfarer.world.rows import Float


class PlaneMotion(NamedTuple):
    """A motion in the plane: about `centre` by radians `turn`, then by `shift`."""

    centre: Float  # [..., 2]
    turn: Float  # [...]
    shift: Float  # [..., 2]

    def moved(self, points: Float, share: Float) -> Float:
        """Points [..., 2] moved by a share of it [...], or shaped to spread over them."""
        moved = np.empty_like(points)
        moved[..., 0], moved[..., 1] = self.moved_xy(points[..., 0], points[..., 1], share)
        return moved

    def moved_xy(self, x: Float, y: Float, share: Float) -> tuple[Float, Float]:
        """`moved` of points whose coordinates are apart, [...] each: numpy is several times as fast
        with them.
        """
        angle = share * self.turn
        cos, sin = np.cos(angle), np.sin(angle)
        dx, dy = x - self.centre[..., 0], y - self.centre[..., 1]
        return (
            cos * dx - sin * dy + self.centre[..., 0] + share * self.shift[..., 0],
            sin * dx + cos * dy + self.centre[..., 1] + share * self.shift[..., 1],
        )

    def spread(self, axes: int) -> "PlaneMotion":
        """The same with `axes` more axes behind the first, for several points each."""
        ones = (1,) * axes
        return PlaneMotion(
            self.centre.reshape(len(self.centre), *ones, 2),
            self.turn.reshape(len(self.turn), *ones),
            self.shift.reshape(len(self.shift), *ones, 2),
        )


def yawed(rotations: Float, angle: Float) -> Float:
    """Rotations [R, F, 4] turned by radians `angle` [R, F] about the vertical."""
    turn = np.zeros((4, *angle.shape), np.float32)
    turn[2], turn[3] = np.sin(angle / 2), np.cos(angle / 2)
    return np.moveaxis(multiply(turn, np.moveaxis(rotations, -1, 0)), 0, -1)
