"""A small software rasteriser: triangle meshes to pixels with a z-buffer, numpy only.

It needs no GPU, window or browser, so that pictures of motion can be made anywhere.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Faces = NDArray[np.int64]

EDGE = -1e-3  # barycentric weight down to which a pixel is inside: leaves no cracks


@dataclass(frozen=True)
class Fragments:
    """Pixels that triangles cover, a row for each pair. P rows."""

    face: NDArray[np.int32]  # [P]
    pixel: NDArray[np.int32]  # [P] row · width + column
    weights: Array  # [P, 3] barycentric


def cover(corners: Array, size: tuple[int, int]) -> Fragments:
    """Every pixel whose middle lies in a triangle. `corners` [F, 3, 2] in pixels, size (w, h).

    Every pixel of every bounding box is tested at once: meant for many small triangles.
    """
    corners = corners.astype(np.float32)
    low = np.clip(np.ceil(corners.min(1) - 0.5), 0, size).astype(np.int32)
    high = np.clip(np.floor(corners.max(1) - 0.5), -1, np.array(size) - 1).astype(np.int32)
    spans = np.maximum(high - low + 1, 0)
    counts = spans[:, 0] * spans[:, 1]
    # weights are linear over the picture: w_b = x · b_x + y · b_y + b_0, and so on
    a = corners[:, 0]
    ab, ac = corners[:, 1] - a, corners[:, 2] - a
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    counts[np.abs(area) < 1e-9] = 0
    scale = 1 / np.where(counts > 0, area, 1)
    b_x, b_y = ac[:, 1] * scale, -ac[:, 0] * scale
    c_x, c_y = -ab[:, 1] * scale, ab[:, 0] * scale
    x0, y0 = low[:, 0] + 0.5 - a[:, 0], low[:, 1] + 0.5 - a[:, 1]  # of the box's first pixel
    slopes = np.stack([b_x, b_y, b_x * x0 + b_y * y0, c_x, c_y, c_x * x0 + c_y * y0], -1)

    face = np.repeat(np.arange(len(corners), dtype=np.int32), counts)
    place = np.arange(len(face), dtype=np.int32)
    place -= np.repeat((np.cumsum(counts) - counts).astype(np.int32), counts)
    down = place // spans[face, 0]
    right = place - down * spans[face, 0]
    bx, by, b0, cx, cy, c0 = np.repeat(slopes.astype(np.float32), counts, axis=0).T
    x, y = right.astype(np.float32), down.astype(np.float32)
    wb = bx * x + by * y + b0
    wc = cx * x + cy * y + c0
    wa = 1 - wb - wc
    inside = np.flatnonzero((wa >= EDGE) & (wb >= EDGE) & (wc >= EDGE))
    face = face[inside]
    pixel = (low[face, 1] + down[inside]) * size[0] + low[face, 0] + right[inside]
    return Fragments(face, pixel, np.stack([wa[inside], wb[inside], wc[inside]], -1))


class Canvas:
    """A see-through picture with depth: draw meshes in any order, then take the `layer`.

    It holds `smooth`² points per pixel, so that edges come out soft.
    """

    def __init__(self, size: tuple[int, int], smooth: int = 2) -> None:
        self.smooth = smooth
        self.size = (size[0] * smooth, size[1] * smooth)
        self._light = np.zeros((self.size[0] * self.size[1], 3), np.float32)
        self._nearness = np.zeros(self.size[0] * self.size[1], np.float32)  # 1/m; 0: empty

    def draw(self, seen: Array, faces: Faces, light: Array) -> None:
        """Draws the faces [F, 3] that turn their front (counter-clockwise) to the camera.

        `seen` [V, 3] is what `Camera.project` gives; `light` [V, 3] is the light of each vertex.
        """
        points = seen[..., :2] * self.smooth
        corners, depth = points[faces], seen[:, 2][faces]
        ab, ac = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        front = ab[:, 0] * ac[:, 1] < ab[:, 1] * ac[:, 0]  # rows count downwards
        shown = np.flatnonzero(front & (depth.min(1) > 0.05))
        found = cover(corners[shown], self.size)
        face = shown[found.face]
        # 1 / depth is linear over the picture, depth is not
        nearness = (found.weights * (1 / depth[face]).astype(np.float32)).sum(-1)
        np.maximum.at(self._nearness, found.pixel, nearness)
        best = nearness >= self._nearness[found.pixel]
        shade = light.astype(np.float32)[faces[face[best]]]
        self._light[found.pixel[best]] = np.einsum("pk,pkc->pc", found.weights[best], shade)

    def layer(self) -> tuple[Array, Array]:
        """Light [H, W, 3], already multiplied by coverage, and coverage [H, W] in 0…1."""
        width, height = self.size
        covered = (self._nearness > 0).astype(np.float32).reshape(height, width)
        return self._pooled(self._light.reshape(height, width, 3)), self._pooled(covered)

    def _pooled(self, points: Array) -> Array:
        # sums of strided views are many times as fast as a mean over two short axes
        total = np.zeros_like(points[:: self.smooth, :: self.smooth])
        for row in range(self.smooth):
            for column in range(self.smooth):
                total += points[row :: self.smooth, column :: self.smooth]
        return total / self.smooth**2
