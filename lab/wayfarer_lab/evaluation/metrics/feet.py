"""What feet do: lifts, stances, slip and turn of each stance, floating, true and false contact.

Soles have shape [T, 2, P, 3]: T frames at 40 fps, the left foot first, P points under each foot
(heel first, toe last), world, metres. Heights are those above the ground under the foot: on a flat
floor the z of the points. Every threshold is part of a definition: a change makes old tables
incomparable.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS

Array = NDArray[np.floating[Any]]
Flags = NDArray[np.bool_]

LIFTED: Final = 0.015
"""Height in metres above which a foot's lowest point counts as lifted."""

SET_DOWN: Final = 0.010
"""Height in metres at which a lift ends; it is lower than LIFTED, so that a lift counts once."""

UP: Final = 0.03
"""Metres: with both feet higher than this the body floats (or jumps, or runs)."""

CONTACT_UP: Final = 0.02
"""Metres: a contact flag of a higher foot is wrong."""

PATCH: Final = 0.010
"""Metres above the lowest point of a foot, up to which points touch the ground with it."""

SWING_SPEED: Final = 0.7
"""Metres per second: a low foot that is faster swings, if the other foot bears the body."""

MIN_STANCE: Final = 3
"""Shortest stance in frames."""

RESTING: Final = round(0.2 * FPS)
"""Frames after which a viewer sees floating: 0.2 s."""


@dataclass(frozen=True)
class Stance:
    """One foot bears, from the frame `start` up to, not with, `stop`."""

    foot: int  # 0 left, 1 right
    start: int
    stop: int
    slip: float  # metres: the farthest that the patch on the ground was from where it began
    turn: float  # degrees: range of the foot's heading


def runs(flags: Flags) -> list[slice]:
    """Runs of True in flags [T]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [slice(a, b) for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)]


def heights(soles: Array) -> Array:
    """Height of the lowest point of each foot above z = 0. [T, 2]"""
    return soles[..., 2].min(-1)


def lifts(height: Array) -> list[list[slice]]:
    """Lifts of each foot by its height [T, 2], without a lift that began before the first
    frame. A foot that comes down to `SET_DOWN` in between is lifted twice.
    """
    found = []
    for foot in (0, 1):
        above = runs(height[:, foot] > SET_DOWN)
        found.append([r for r in above if r.start > 0 and (height[r, foot] > LIFTED).any()])
    return found


def lift_count(height: Array) -> int:
    """Lifts of both feet together."""
    return sum(map(len, lifts(height)))


def lift_tops(height: Array) -> list[float]:
    """The greatest height of each lift of both feet, metres."""
    return [
        float(height[lift, foot].max()) for foot, mine in enumerate(lifts(height)) for lift in mine
    ]


def patch_shift(soles: Array) -> Array:
    """Horizontal way, since the frame before, of the points of each foot that touch the ground.

    The mean over the points that are within `PATCH` of the foot's lowest one in both frames; of
    the lowest one where there are none. A foot that rolls shifts nothing. [T - 1, 2, 2]
    """
    height = soles[..., 2]
    touching = height < height.min(-1, keepdims=True) + PATCH
    both = touching[1:] & touching[:-1]
    lowest = np.zeros_like(both)
    np.put_along_axis(lowest, height[1:].argmin(-1)[..., None], True, -1)
    weight = np.where(both.any(-1, keepdims=True), both, lowest)[..., None]
    way = np.diff(soles[..., :2], axis=0)
    return (weight * way).sum(-2) / weight.sum(-2)


def heading(soles: Array) -> Array:
    """Degrees about +Z of the line from heel to balls of each foot, without jumps. [T, 2]"""
    along = soles[:, :, 1:-1, :2].mean(2) - soles[:, :, 0, :2]
    return np.degrees(np.unwrap(np.arctan2(-along[..., 0], along[..., 1]), axis=0))


def bearing(soles: Array, height: Array | None = None) -> Flags:
    """Feet that bear the body. [T, 2]

    A foot that is not lifted (lower than `LIFTED`) bears, unless it swings: it is faster than
    `SWING_SPEED` while the other one is low and slower. Where both are fast, both bear: a body
    that skates on both feet is not in the air.
    """
    height = heights(soles) if height is None else height
    low = height < LIFTED
    way = np.linalg.norm(patch_shift(soles), axis=-1) * FPS
    speed = np.concatenate([way[:1], way])
    firm = low & (speed < SWING_SPEED)
    return low & (firm | ~firm[:, ::-1])


def stances(soles: Array, height: Array | None = None) -> list[Stance]:
    """All stances of both feet, in order of their beginning, with their slip and turn."""
    shift, turned = patch_shift(soles), heading(soles)
    bears = bearing(soles, height)
    found = []
    for foot in (0, 1):
        for run in runs(bears[:, foot]):
            if run.stop - run.start < MIN_STANCE:
                continue
            way = shift[run.start : run.stop - 1, foot].cumsum(0)
            found.append(
                Stance(
                    foot,
                    run.start,
                    run.stop,
                    float(np.linalg.norm(way, axis=-1).max()),
                    float(np.ptp(turned[run, foot])),
                )
            )
    return sorted(found, key=lambda stance: stance.start)


def slides(soles: Array, height: Array) -> list[float]:
    """Metres that a foot came while it was not lifted, for each time between two lifts of either
    foot: the farthest that its patch on the ground was from where it began.

    It need not bear weight: a foot that always hovers low slides, too.
    """
    shift, found = patch_shift(soles), []
    for foot, mine in enumerate(lifts(height)):
        down = np.ones(len(height), bool)
        for lift in mine:
            down[lift] = False
        for run in runs(down):
            way = shift[run.start : run.stop - 1, foot].cumsum(0)
            found.append(float(np.linalg.norm(way, axis=-1).max(initial=0.0)))
    return found


def airborne(soles: Array, height: Array | None = None) -> float:
    """Share of frames in which neither foot bears: a hop, a flight, or a body that hovers."""
    return float((~bearing(soles, height).any(-1)).mean())


def pivot(found: list[Stance]) -> float:
    """Degrees that a bearing foot turned on the ground, all stances together, mean of both feet."""
    return sum(stance.turn for stance in found) / 2


def floating(height: Array) -> Flags:
    """Frames in which the lower foot is higher than `UP`. [T]"""
    return height.min(-1) > UP


def floats_seen(height: Array) -> bool:
    """Whether both feet are up for 0.2 s on end."""
    return any(run.stop - run.start >= RESTING for run in runs(floating(height)))


def false_contact(contacts: Flags, height: Array) -> float:
    """Share of the contact flags [T, 2] whose foot is higher than `CONTACT_UP`.

    NaN without flags.
    """
    return float((height > CONTACT_UP)[contacts].mean()) if contacts.any() else float("nan")


def contact_while_floating(contacts: Flags, height: Array) -> float:
    """Share of the floating frames with a contact flag. NaN when no frame floats."""
    up = floating(height)
    return float(contacts[up].any(-1).mean()) if up.any() else float("nan")


def double_support(height: Array) -> float:
    """Share of frames in which neither foot is lifted."""
    return float((height < LIFTED).all(-1).mean())


def first_foot(height: Array) -> int | None:
    """The foot that is lifted first (0 left, 1 right), or None."""
    left, right = lifts(height)
    starts = [found[0].start if found else np.inf for found in (left, right)]
    return None if min(starts) == np.inf else int(np.argmin(starts))
