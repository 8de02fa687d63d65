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
        """Points [..., 2] moved by a share [...] of it."""
        x, y = np.moveaxis(points - self.centre, -1, 0)
        cos, sin = np.cos(share * self.turn), np.sin(share * self.turn)
        turned = np.stack([cos * x - sin * y, sin * x + cos * y], -1)
        return turned + self.centre + share[..., None] * self.shift

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
