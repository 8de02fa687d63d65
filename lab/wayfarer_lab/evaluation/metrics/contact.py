"""How a body touches the floor (z = 0, world, metres). Every threshold is part of a definition.

Points have shape [..., T, P, 3]: T frames at `FPS`, P markers. *Soles* are the markers under the
feet (`BodyModel.sole_markers`), left ones first, as many left as right. Speeds are central
differences inside and one-sided at the ends (`kinematics.velocity`).

A change of any number here makes old tables incomparable: raise `metrics.VERSION`.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS, PRIMITIVE_FRAMES
from wayfarer_lab.evaluation.metrics.kinematics import velocity

Array = NDArray[np.floating[Any]]

CONTACT_HEIGHT: Final = 0.05
"""Metres: a marker this near the floor is in contact (paper Sec. 4.1)."""

CONTACT_SPEED: Final = 0.075
"""Metres per second: a marker this slow does not skate (paper Sec. 4.1)."""

SLIDE_HEIGHT: Final = 0.03
"""Metres: a sole marker below this bears weight."""

SKATE_SPEED: Final = 0.15
"""Metres per second, horizontal: a foot on the floor that moves faster skates (MOJO, PRIMAL)."""

DEEP: Final = 0.03
"""Metres below the floor that an eye notices."""

FLOATING: Final = 0.05
"""Metres: a body whose lowest marker is higher floats (or runs: flight phases count too)."""


def paper_contact(markers: Array) -> Array:
    """Contact score of a primitive, Eq. 11: one value in 0…1 per primitive [...].

    The minima run over all markers *and* frames, so one touching, slow marker is enough: the
    score saturates near 1 and is reported for comparison with the paper only.
    """
    height = np.abs(markers[..., 2]).min((-2, -1))
    speed = np.linalg.norm(velocity(markers), axis=-1).min((-2, -1))
    return _contact_score(height, speed)


def paper_contact_of_clip(markers: Array) -> Array:
    """Mean `paper_contact` over the whole primitives (10 frames, no overlap) of clips. [...]"""
    whole = markers.shape[-3] // PRIMITIVE_FRAMES
    cut = markers[..., : whole * PRIMITIVE_FRAMES, :, :]
    primitives = cut.reshape(*cut.shape[:-3], whole, PRIMITIVE_FRAMES, *cut.shape[-2:])
    return paper_contact(primitives).mean(-1)


def strict_contact(soles: Array) -> Array:
    """Eq. 11 for each frame, over sole markers only (as DIMOS does): 0…1 [..., T]."""
    height = np.abs(soles[..., 2]).min(-1)
    speed = np.linalg.norm(velocity(soles), axis=-1).min(-1)
    return _contact_score(height, speed)


def slide_speed(soles: Array) -> float:
    """Median horizontal speed of the lowest sole marker, m/s, over frames where it is below 3 cm.

    A median, because swing feet pass low and fast and would rule a mean. NaN when no frame has
    a sole below 3 cm.
    """
    height, speed = _lowest(soles)
    bearing = height < SLIDE_HEIGHT
    return float(np.median(speed[bearing])) if bearing.any() else float("nan")


def both_feet_skating(soles: Array) -> NDArray[np.bool_]:
    """Frames in which *both* feet skate: bool [..., T]; its mean is the skating ratio of MOJO.

    A foot skates when its lowest sole marker is within 5 cm of the floor and faster than
    0.15 m/s horizontally.
    """
    half = soles.shape[-2] // 2
    skates = []
    for foot in (soles[..., :half, :], soles[..., half:, :]):
        height, speed = _lowest(foot)
        skates.append((np.abs(height) < CONTACT_HEIGHT) & (speed > SKATE_SPEED))
    return skates[0] & skates[1]


def heel_skating(heels: Array, limit: float) -> NDArray[np.bool_]:
    """MOJO's own measure, steps in which both heels skate: heels [..., T, 2, 3] → [..., T-1].

    A heel marker skates when it comes to lie within 5 cm of the floor and has moved faster than
    `limit`, horizontally, since the frame before. MOJO counts more than 5 mm a frame: 0.075 m/s at
    its 15 fps, 0.2 m/s at our 40.
    """
    speed = np.linalg.norm(np.diff(heels[..., :2], axis=-3), axis=-1) * FPS
    near = np.abs(heels[..., 1:, :, 2]) < CONTACT_HEIGHT
    return ((speed > limit) & near).all(-1)


def penetration(markers: Array) -> Array:
    """Depth of the lowest marker below the floor, metres ≥ 0, for each frame [..., T]."""
    return np.maximum(-markers[..., 2].min(-1), 0.0)


def clearance(markers: Array) -> Array:
    """Height of the lowest marker above the floor, metres ≥ 0, for each frame [..., T]."""
    return np.maximum(markers[..., 2].min(-1), 0.0)


def _contact_score(height: Array, speed: Array) -> Array:
    # Eq. 11: s = exp(-(min|Y_z| - 0.05)+) · exp(-(min|Y_vel| - 0.075)+)
    above = np.maximum(height - CONTACT_HEIGHT, 0.0)
    faster = np.maximum(speed - CONTACT_SPEED, 0.0)
    return np.exp(-above) * np.exp(-faster)


def _lowest(points: Array) -> tuple[Array, Array]:
    """Height and horizontal speed of the lowest point of each frame, both [..., T]."""
    lowest = points[..., 2].argmin(-1)[..., None]
    speed = np.linalg.norm(velocity(points)[..., :2], axis=-1)
    return (
        np.take_along_axis(points[..., 2], lowest, -1)[..., 0],
        np.take_along_axis(speed, lowest, -1)[..., 0],
    )
