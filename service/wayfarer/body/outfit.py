"""Skin, hair and clothes as regions of a body with colours, so that people can be told apart."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel

Array = NDArray[np.floating[Any]]

SKIN, HAIR, SHIRT, TROUSERS, SHOES, EYES = range(6)  # where two meet, the greater is outside

REGIONS = ("skin", "hair", "shirt", "trousers", "shoes", "eyes")
"""Their names, in the order of the constants above."""

ROUGHNESS = (0.75, 0.6, 0.9, 0.9, 0.6, 0.35)
"""Roughness of each region, as glTF defines it."""

PALETTES = (
    ("#f2d3bd", "#e5b899", "#cf9a78", "#a8714f", "#7b4b33", "#5d3826"),
    ("#1d1916", "#3b2a20", "#5d4030", "#8a6642", "#b8935a", "#7d7a78"),
    ("#c8553d", "#2f6f8f", "#e0a83e", "#4c8c6b", "#7a5c99", "#e8e4da", "#35465c", "#b9637d"),
    ("#2c3340", "#44526b", "#5b5147", "#20242b", "#8a8371", "#3d4a3e"),
    ("#1f2023", "#e9e6e0", "#6b4a35", "#7d2f2f"),
    ("#4a3c34",),  # one colour for the whole eye: dark looks right from afar
)
"""sRGB choices per region, in the order of the constants above."""


def regions(body: BodyModel) -> NDArray[np.int64]:
    """Region of each vertex [V]: the body's own, else by the joint that moves it most."""
    if body.regions is not None:
        return body.regions.astype(np.int64)
    names = np.array(body.joint_names)
    by_joint = np.full(len(names), SKIN)
    for region, parts in {
        SHIRT: ("spine1", "spine2", "spine3", "collar", "shoulder"),
        TROUSERS: ("pelvis", "hip", "knee"),
        SHOES: ("ankle", "foot"),
    }.items():
        for part in parts:
            by_joint[[part in name for name in names]] = region
    owner = np.take_along_axis(body.skin_joints, body.skin_weights.argmax(-1)[:, None], -1)[:, 0]
    return by_joint[owner]


def outfit(style: int) -> Array:
    """Colours (sRGB, 0…1) per region [6, 3]; `style` is a seed: the same seed, the same look."""
    rng = np.random.default_rng(style)
    chosen = [palette[rng.integers(len(palette))] for palette in PALETTES]
    return np.array([[int(code[k : k + 2], 16) for k in (1, 3, 5)] for code in chosen]) / 255


def linear_colours(srgb: Array) -> Array:
    """Convert sRGB to linear light (IEC 61966-2-1), which glTF's factors are in."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
