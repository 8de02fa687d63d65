"""A motion as its file describes it: joints with rotations, on the file's own skeleton.

A joint is the *start* of the bone of the same name (BVH's view; ASF is converted to it).
World rotations are relative to the file's zero pose, so they are identity in that pose.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def euler_matrices(angles: Array, order: str) -> Array:
    """Rotation matrices [..., 3, 3] from angles [..., K] in degrees about the axes `order`.

    The first letter is applied last: "ZYX" gives Rz · Ry · Rx.
    """
    matrix = np.broadcast_to(np.eye(3), (*angles.shape[:-1], 3, 3))
    for k, axis in enumerate(order):
        radians = np.deg2rad(angles[..., k])
        cos, sin = np.cos(radians), np.sin(radians)
        turn = np.zeros((*radians.shape, 3, 3))
        i = "XYZ".index(axis)
        j, k2 = (i + 1) % 3, (i + 2) % 3
        turn[..., i, i] = 1.0
        turn[..., j, j] = turn[..., k2, k2] = cos
        turn[..., k2, j] = sin
        turn[..., j, k2] = -sin
        matrix = matrix @ turn
    return matrix


@dataclass(frozen=True)
class MocapSkeleton:
    """Joint names, parents (-1 for the root; parents come first) and zero-pose offsets.

    `ends` holds the bone tips of joints without children (end sites), by joint name.
    """

    names: tuple[str, ...]  # J
    parents: tuple[int, ...]  # J
    offsets: Array  # [J, 3] from the parent, file units
    ends: dict[str, Array]

    def rest_places(self) -> Array:
        """Joint places in the zero pose with the root at the origin [J, 3]."""
        places = np.zeros_like(self.offsets)
        for j, parent in enumerate(self.parents):
            if parent >= 0:
                places[j] = places[parent] + self.offsets[j]
        return places

    def with_offsets(self, offsets: dict[str, Array]) -> "MocapSkeleton":
        """The same skeleton with some offsets replaced."""
        changed = self.offsets.copy()
        for name, offset in offsets.items():
            changed[self.names.index(name)] = offset
        return replace(self, offsets=changed)


@dataclass(frozen=True)
class SkeletonMotion:
    """Joint rotations of a clip on its skeleton, in the file's units and axes."""

    skeleton: MocapSkeleton
    root: Array  # [N, 3]
    local: Array  # [N, J, 3, 3] relative to the parent
    fps: float | None  # None: the file does not say
    shifts: dict[int, Array] = field(default_factory=dict)
    """Offsets [N, 3] by joint, for joints below the root whose offset moves."""

    def __len__(self) -> int:
        return len(self.root)

    def cut(self, start: int, stop: int | None = None) -> "SkeletonMotion":
        """Frames start..stop."""
        shifts = {j: offsets[start:stop] for j, offsets in self.shifts.items()}
        return replace(
            self, root=self.root[start:stop], local=self.local[start:stop], shifts=shifts
        )

    def world(self) -> tuple[Array, Array]:
        """World rotations [N, J, 3, 3] and joint places [N, J, 3]."""
        rotations = np.empty_like(self.local)
        places = np.empty(self.local.shape[:-1])
        for j, parent in enumerate(self.skeleton.parents):
            if parent < 0:
                rotations[:, j], places[:, j] = self.local[:, j], self.root
            else:
                rotations[:, j] = rotations[:, parent] @ self.local[:, j]
                if j in self.shifts:
                    arm = (rotations[:, parent] @ self.shifts[j][..., None])[..., 0]
                else:
                    arm = rotations[:, parent] @ self.skeleton.offsets[j]
                places[:, j] = places[:, parent] + arm
        return rotations, places
