"""Light and colour: how surfaces shine, and how light becomes the numbers of a picture.

Light is linear (twice the number, twice the light) until `encode` writes it as sRGB.
"""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.outfit import linear_colours

Array = NDArray[np.floating[Any]]

SUN: Array = np.array([1.0, 0.96, 0.88]) * 0.80
SKY: Array = np.array([0.86, 0.93, 1.0]) * 0.52  # from above
BOUNCE: Array = np.array([1.0, 0.94, 0.86]) * 0.32  # from the floor
WRAP = 0.2  # how far light reaches round an edge: skin and cloth are soft
STEPS = 4096


def colour(code: str) -> Array:
    """Linear light [3] of an sRGB colour "#rrggbb"."""
    return linear_colours(np.array([int(code[k : k + 2], 16) for k in (1, 3, 5)]) / 255)


def to_sun(azimuth: float) -> Array:
    """Unit vector [3] to the sun: high, to the left of a camera that looks along `azimuth` and
    a little on its side of things, so that shadows fall to the right, where they can be seen.
    """
    right = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    ahead = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    way = -0.62 * right - 0.42 * ahead + np.array([0.0, 0.0, 1.0])
    return way / np.linalg.norm(way)


def shine(albedo: Array, normals: Array, sun: Array) -> Array:
    """Light that surfaces send back: albedo [V, 3], unit normals [V, 3], sun [3]. [V, 3]."""
    direct = np.clip((normals @ sun + WRAP) / (1 + WRAP), 0, 1)[:, None]
    above = (0.5 + 0.5 * normals[:, 2])[:, None]
    return albedo * (direct * SUN + above * SKY + (1 - above) * BOUNCE)


@cache
def _table() -> NDArray[np.uint8]:
    light = np.arange(STEPS + 1) / STEPS
    srgb = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return (srgb * 255).round().astype(np.uint8)


def encode(light: Array) -> NDArray[np.uint8]:
    """Linear light → sRGB bytes of the same shape (IEC 61966-2-1); above 1 is white."""
    return _table()[(np.clip(light, 0, 1) * STEPS).astype(np.uint16)]
