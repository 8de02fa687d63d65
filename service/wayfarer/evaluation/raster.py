"""A small software rasteriser: triangle meshes to pixels with a z-buffer, numpy only.

It needs no GPU, window or browser, so that pictures of motion can be made anywhere.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.mesh import vertex_normals

Array = NDArray[np.floating[Any]]
Faces = NDArray[np.int64]


@dataclass(frozen=True)
class Camera:
    """Orthographic camera: `right` and `up` span the picture, `right × up` points at the viewer."""

    right: Array  # [3] unit
    up: Array  # [3] unit
    centre: Array  # [3] world point in the middle of the picture
    pixels_per_metre: float

    def project(self, points: Array, size: tuple[int, int]) -> Array:
        """World [..., 3] → column, row (pixels, row 0 on top), nearness (metres). [..., 3]."""
        axes = np.stack([self.right, -self.up, np.cross(self.right, self.up)])
        seen = (points - self.centre) @ axes.T
        seen[..., :2] *= self.pixels_per_metre
        seen[..., 0] += size[0] / 2
        seen[..., 1] += size[1] / 2
        return seen


class Canvas:
    """A picture with depth: draw meshes in any order, then read `pixels`."""

    def __init__(self, width: int, height: int, background: Array) -> None:
        self.size = (width, height)
        self.pixels = np.empty((height, width, 3))
        self.pixels[:] = background
        self.nearness = np.full(height * width, -np.inf)

    def draw_mesh(self, camera: Camera, vertices: Array, faces: Faces, colours: Array) -> None:
        """Draw [V, 3] with [F, 3], lit from over the viewer's left shoulder; colours [V, 3] 0…1."""
        normals = vertex_normals(vertices, faces)
        viewer = np.cross(camera.right, camera.up)
        lamp = -0.42 * camera.right + 0.55 * camera.up + 0.72 * viewer
        light = 0.40 + 0.60 * np.clip(normals @ lamp, 0, 1)
        self._fill(camera.project(vertices, self.size), faces, colours * light[:, None])

    def _fill(self, seen: Array, faces: Faces, colours: Array) -> None:
        """Fill triangles: every pixel of every bounding box is tested at once."""
        width, height = self.size
        corners = seen[faces]  # [F, 3, 3]
        limit = np.array([width - 1, height - 1])
        low = np.clip(np.ceil(corners[..., :2].min(1) - 0.5), 0, limit).astype(np.int64)
        high = np.clip(np.floor(corners[..., :2].max(1) - 0.5), -1, limit).astype(np.int64)
        spans = np.maximum(high - low + 1, 0)
        counts = spans[:, 0] * spans[:, 1]
        face = np.repeat(np.arange(len(faces)), counts)
        place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        column = low[face, 0] + place % spans[face, 0]
        row = low[face, 1] + place // spans[face, 0]

        a, b, c = (corners[face, k] for k in range(3))
        x, y = column + 0.5, row + 0.5
        area = _cross(b, a, c[:, 0], c[:, 1])
        inside_b, inside_c = _cross(c, a, x, y), _cross(a, b, x, y)
        with np.errstate(divide="ignore", invalid="ignore"):
            wb, wc = -inside_b / area, -inside_c / area
        wa = 1 - wb - wc
        kept = (np.abs(area) > 1e-9) & (wa >= -1e-6) & (wb >= -1e-6) & (wc >= -1e-6)
        weights = np.stack([wa, wb, wc], -1)[kept]
        face, pixel = face[kept], (row * width + column)[kept]
        near = np.einsum("pk,pk->p", weights, corners[face, :, 2])

        order = np.lexsort((near, pixel))  # the last of each pixel is the nearest
        last = np.append(np.diff(pixel[order]) != 0, True) if len(order) else np.zeros(0, bool)
        best = order[last]
        best = best[near[best] > self.nearness[pixel[best]]]
        self.nearness[pixel[best]] = near[best]
        shade = np.einsum("pk,pkc->pc", weights[best], colours[faces[face[best]]])
        self.pixels.reshape(-1, 3)[pixel[best]] = shade

    def image(self, supersampling: int = 1) -> NDArray[np.uint8]:
        """Pixels [H, W, 3], averaged over blocks of `supersampling`²."""
        s = supersampling
        height, width = self.size[1] // s, self.size[0] // s
        blocks = self.pixels[: height * s, : width * s].reshape(height, s, width, s, 3)
        return (np.clip(blocks.mean((1, 3)), 0, 1) * 255).round().astype(np.uint8)


def _cross(origin: Array, to: Array, x: Array, y: Array) -> Array:
    """2D cross product of (to - origin) and ((x, y) - origin)."""
    return (to[:, 0] - origin[:, 0]) * (y - origin[:, 1]) - (to[:, 1] - origin[:, 1]) * (
        x - origin[:, 0]
    )
