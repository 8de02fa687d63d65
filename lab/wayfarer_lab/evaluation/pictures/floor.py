"""The floor z = 0 with its grid, what is painted on it, and the shadows that fall on it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFilter

from wayfarer_lab.evaluation.pictures.camera import Camera, View
from wayfarer_lab.evaluation.pictures.light import colour
from wayfarer_lab.evaluation.pictures.raster import Faces, cover

Array = NDArray[np.floating[Any]]

EARTH, LINE, HORIZON = (
    colour(code).astype(np.float32) for code in ("#d8d2c8", "#a9a196", "#e6ebee")
)
GRID = ((1.0, 0.024, 0.85), (0.25, 0.010, 0.40))  # metres apart, metres wide, opacity
HAZE = (0.9, 4.0)  # distances, in units of that to the target, over which the floor fades

TEXEL = 0.0125  # metres
BORDER = 8  # texels around a shadow's patch, for its soft edge
NEAR = 0.3  # metres before the pinhole in which marks are not drawn
SMOOTH = 2  # points of a mark per pixel, each way
SUN_KEPT, SKY_KEPT = 0.45, 0.65  # of the floor's light that a full shadow takes away
NEAR_FLOOR = 0.10  # metres over which the shadow right under a foot fades


@dataclass(frozen=True)
class Mark:
    """A line on the floor."""

    way: Array  # [N, 2] world
    width: float  # metres
    paint: str  # "#rrggbb"
    opacity: float = 1.0


def ring(centre: Sequence[float], radius: float, width: float, paint: str) -> Mark:
    """A circle, such as a goal."""
    angle = np.linspace(0, 2 * np.pi, 65)
    return Mark(np.stack([np.cos(angle), np.sin(angle)], -1) * radius + centre[:2], width, paint)


@dataclass(frozen=True)
class Shadow:
    """Light kept from a patch of the floor: 0 dark … 255 open, by texel."""

    corner: Array  # [2] world place of the patch's first texel
    sun: NDArray[np.uint8]  # [rows, columns], rows along +Y
    sky: NDArray[np.uint8]  # the part that the body close above hides


def cast(vertices: Array, faces: Faces, sun: Array) -> Shadow:
    """Shadow of a closed mesh [V, 3], [F, 3] in a sun that stands in the direction `sun` [3]."""
    height = np.maximum(vertices[:, 2], 0)
    above = vertices[:, :2]
    thrown = above - height[:, None] * sun[:2] / sun[2]
    # texels are fixed to the world: edges do not crawl from frame to frame
    first = np.floor(np.minimum(thrown.min(0), above.min(0)) / TEXEL) - BORDER
    last = np.ceil(np.maximum(thrown.max(0), above.max(0)) / TEXEL) + BORDER
    size = (int(last[0] - first[0]), int(last[1] - first[1]))

    lit = np.full(size[0] * size[1], 255, np.uint8)
    lit[cover((thrown / TEXEL - first)[_facing(thrown, faces, 1)], size).pixel] = 0
    # a low body part keeps the sky from what lies under it; a lifted foot keeps away less
    low = faces[height[faces[:, 0]] < 4 * NEAR_FLOOR]
    low = _facing(above, low, -1)
    under = cover((above / TEXEL - first)[low], size)
    lowest = np.full(size[0] * size[1], np.inf)
    np.minimum.at(lowest, under.pixel, height[low].min(1)[under.face])
    open_sky = (255 * (1 - np.exp(-lowest / NEAR_FLOOR))).astype(np.uint8)
    return Shadow(first * TEXEL, _blurred(lit, size, 1.2), _blurred(open_sky, size, 3.0))


def _facing(flat: Array, faces: Faces, sign: int) -> Faces:
    """Faces that run counter-clockwise (sign 1) or clockwise (-1) in the plane: half of a mesh."""
    ab = flat[faces[:, 1]] - flat[faces[:, 0]]
    ac = flat[faces[:, 2]] - flat[faces[:, 0]]
    return faces[(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]) * sign > 0]


def _blurred(texels: NDArray[np.uint8], size: tuple[int, int], radius: float) -> NDArray[np.uint8]:
    picture = Image.fromarray(texels.reshape(size[1], size[0]))
    return np.asarray(picture.filter(ImageFilter.GaussianBlur(radius)))


class FloorImage:
    """The floor as a view sees it from a height; it does not change when the camera slides."""

    def __init__(self, view: View, height: float) -> None:
        width, rows = view.size
        columns = (np.arange(width) + 0.5 - width / 2) / view.focal
        lines = (np.arange(rows) + 0.5 - rows / 2) / view.focal
        rays = columns[None, :, None] * view.axes[0] + lines[:, None, None] * view.axes[1]
        rays = rays + view.axes[2]
        sinks = np.maximum(-rays[..., 2], 1e-4)
        ahead = height / sinks  # metres to the floor [H, W]
        self.offset = (rays[..., :2] * ahead[..., None]).astype(np.float32)
        # how much floor a pixel sees, along X and along Y
        down, right = np.gradient(self.offset, axis=(0, 1))
        self.sharpness = 1 / np.maximum(np.abs(down) + np.abs(right), 1e-6)
        start, end = HAZE
        away = np.clip((ahead / view.distance - start) / (end - start), 0, 1)
        away[rays[..., 2] > -1e-4] = 1
        self.haze = (1 - (1 - away) ** 2)[..., None].astype(np.float32)

    def paint(self, eye: Array, shadows: Sequence[Shadow], painted: tuple[Array, Array]) -> Array:
        """Light [H, W, 3] with the camera over `eye` [2]; `painted`: light times cover, cover."""
        place = self.offset + eye.astype(np.float32)
        cover = np.zeros(place.shape[:2], np.float32)
        for apart, width, strength in GRID:
            beside = np.abs(place - apart * np.round(place / apart)) - width / 2
            # a pixel wider than the line shows it in part only
            whole = strength * np.minimum(width * self.sharpness, 1)
            line = np.clip(0.5 - beside * self.sharpness, 0, 1) * whole
            cover = np.maximum(cover, np.maximum(line[..., 0], line[..., 1]))
        floor: Array = EARTH + cover[..., None] * (LINE - EARTH)
        paint, opacity = painted
        floor = floor * (1 - opacity[..., None]) + paint
        for shadow in shadows:
            self._shade(floor, place, shadow)
        return floor + self.haze * (HORIZON - floor)

    def _shade(self, floor: Array, place: Array, shadow: Shadow) -> None:
        """Darkens the floor, with the patch's texels blended for pixels between them."""
        rows, columns = shadow.sun.shape
        x = (place[..., 0] - np.float32(shadow.corner[0])) / TEXEL - 0.5
        y = (place[..., 1] - np.float32(shadow.corner[1])) / TEXEL - 0.5
        inside = (x >= 0) & (x < columns - 1) & (y >= 0) & (y < rows - 1)
        x, y = x[inside], y[inside]
        column, row = x.astype(np.int32), y.astype(np.int32)
        right, down = x - column, y - row
        first = row * columns + column
        light = np.ones(len(x), np.float32)
        for patch, kept in ((shadow.sun, SUN_KEPT), (shadow.sky, SKY_KEPT)):
            texels = patch.ravel()
            near = texels[first] * (1 - right) + texels[first + 1] * right
            far = texels[first + columns] * (1 - right) + texels[first + columns + 1] * right
            light *= 1 - kept + kept / 255 * (near + down * (far - near))
        floor[inside] *= light[:, None]


@lru_cache(maxsize=8)
def floor_of(view: View, height: float) -> FloorImage:
    """The floor of a view; a camera that only slides uses one for all its pictures."""
    return FloorImage(view, height)


def painted(camera: Camera, marks: Sequence[Mark]) -> tuple[Array, Array]:
    """Marks as seen: light times cover [H, W, 3], and cover [H, W]."""
    width, height = camera.view.size
    light = np.zeros((height, width, 3), np.float32)
    cover = np.zeros((height, width), np.float32)
    for mark in marks:
        seen = camera.project(np.concatenate([mark.way, np.zeros((len(mark.way), 1))], -1))
        ahead = seen[:, 2] >= NEAR
        if not ahead.any():
            continue
        pixels = mark.width * camera.view.focal / np.median(seen[ahead, 2]) * SMOOTH
        mask = Image.new("L", (width * SMOOTH, height * SMOOTH))
        draw = ImageDraw.Draw(mask)
        for part in np.split(seen, np.flatnonzero(np.diff(ahead)) + 1):
            if len(part) > 1 and part[0, 2] >= NEAR:
                points = (part[:, :2] * SMOOTH).ravel().tolist()
                draw.line(points, 255, max(round(pixels), 1), joint="curve")
        share = np.asarray(mask.reduce(SMOOTH), np.float32)[..., None] / 255 * mark.opacity
        light += share * (colour(mark.paint).astype(np.float32) - light)
        cover += share[..., 0] * (1 - cover)
    return light, cover
