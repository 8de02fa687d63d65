"""Leaning bodies straighten up: nothing else takes a lean off.

The model goes on from how a person stands, and does not mind a lean. Without this rule 16 and 29 of
48 people who stood for a minute leaned by more than 32 degrees and had to get up (two seeds); with
it none and one, and 95 in 100 lean by less than 13 degrees. So every step takes a part of the lean
beyond `MOST` off, with a turn of the spine that is spread over the new frames. The same turn goes
into the markers that the next step starts from, and the next primitive follows them.

World space, metres, radians. Pure functions of columns: rows do not influence each other.
"""

from math import radians
from typing import Final, NamedTuple

import numpy as np

from wayfarer.body.landmarks import marker_names
from wayfarer.body.skeleton import joint_names
from wayfarer.spec import NEW_FRAMES, SEED_FRAMES
from wayfarer.world.agents.slots import Mode
from wayfarer.world.output.quaternion import (
    Array,
    cross,
    dot,
    inverse,
    length,
    multiply,
    rotate,
    stacked,
)
from wayfarer.world.rows import Float, Int8

EASE: Final = (0.5 - 0.5 * np.cos(np.pi * np.arange(1, NEW_FRAMES + 1) / NEW_FRAMES)).astype(
    np.float32
)
"""Share of the turn in each new frame: nothing at the seam, all of it at the end."""


class Step(NamedTuple):
    """New frames of a step, and the markers that the next one starts from."""

    translation: Float  # [A, F, 3] hips
    rotations: Float  # [A, F, 22, 4]
    markers: Float  # [A, S, 67, 3] of the last S frames


MOST: Final = radians(14)
MOST_ON_THE_SPOT: Final = radians(9)
"""Lean of the spine, in any direction, that is left to walkers, and to all others."""

SHARE: Final = 0.35
"""Share of the lean beyond it that a step takes off, …"""

TURN_MOST: Final = radians(5)
"""… and radians at most."""

PIVOT: Final = 0.21
"""Metres above the hips joint about which the spine bends as a whole."""

SPINE: Final = [joint_names().index(f"spine{k}") for k in (1, 2, 3)]

_BELOW: Final = (
    "FWT", "BWT", "HIP", "THI", "KNE", "KNI", "SHN", "CLF", "ANK", "HEE", "TOE", "MT1", "MT5",
)  # fmt: skip
"""Markers of hips and legs, without their sides."""


def _share(marker: str) -> float:
    """Multiple of the spine's turn that a marker goes along with. Each joint of the spine turns by
    half of what the spine does in the mean.
    """
    if marker[1:] in _BELOW or "SOLE" in marker:
        return 0
    return {"LNWST": 0.5, "RNWST": 0.5, "T10": 1}.get(marker, 1.5)


_ALL: Final = np.array([_share(name) for name in marker_names()], np.float32)
_MOVED: Final = np.flatnonzero(_ALL)
_SHARES: Final = _ALL[_MOVED]


def righted(mode: Int8, step: Step) -> Step:
    """The step with a part of the lean taken off by its end of those [A] who lean too far, `mode`
    being theirs during it. The others are returned as they are, and the same step if nobody does.
    """
    up = _up(np.moveaxis(step.rotations[:, -1, [0, *SPINE]], -1, 0))  # [3, A]
    aside = length(up[:2])
    lean = np.arctan2(aside, up[2])
    walks = np.isin(mode, (Mode.WALKING, Mode.STOPPING, Mode.STRAFING))
    excess = lean - np.where(walks, np.float32(MOST), np.float32(MOST_ON_THE_SPOT))
    rows = np.flatnonzero(excess > 0)
    if not len(rows):
        return step
    back = np.minimum(SHARE * excess[rows], TURN_MOST)[:, None] * EASE  # [R, F]
    x, y = up[:2, rows] / np.maximum(aside[rows], 1e-6)
    axis = stacked(y, -x, np.zeros_like(x))  # about which the spine comes up
    rotations, markers = step.rotations.copy(), step.markers.copy()
    rotations[rows] = _bent_back(step.rotations[rows], axis[..., None], back)
    last = slice(-SEED_FRAMES, None)
    hips = np.moveaxis(step.rotations[rows, last, 0], -1, 0)
    above = rotate(hips, np.array([0, 0, PIVOT], np.float32)[:, None, None])
    pivot = np.moveaxis(step.translation[rows, last], -1, 0) + above
    markers[rows] = _swung(markers[rows], pivot[..., None], axis[..., None, None], back[:, last])
    return step._replace(rotations=rotations, markers=markers)


def _up(trunk: Array) -> Array:
    """Mean of where the spine's joints point up [3, A]; rotations [4, A, 4] from hips to chest."""
    turn = trunk[..., 0]
    total = np.zeros((3, turn.shape[1]), np.float32)
    for joint in range(1, 4):
        turn = multiply(turn, trunk[..., joint])
        x, y, z, w = turn
        total += stacked(2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y))
    return total / 3


def _bent_back(rotations: Float, axis: Array, back: Array) -> Float:
    """Rotations [R, F, 22, 4] with the spine turned by radians `back` [R, F] about the world's
    `axis` [3, R, 1] in the mean.
    """
    local = np.moveaxis(rotations, -1, 0)  # [4, R, F, 22]
    above, half = local[..., 0], back / 2
    bent = rotations.copy()
    for joint in SPINE:
        about = rotate(inverse(above), axis) * np.sin(half / 2)
        turn = stacked(*about, np.cos(half / 2))
        bent[:, :, joint] = np.moveaxis(multiply(turn, local[..., joint]), 0, -1)
        above = multiply(above, local[..., joint])
    return bent


def _swung(markers: Float, pivot: Array, axis: Array, back: Array) -> Float:
    """Markers [R, S, 67, 3], those above the hips turned by `back` [R, S] about `axis` [3, R, 1, 1]
    through `pivot` [3, R, S, 1] (Rodrigues).
    """
    arm = np.moveaxis(markers[:, :, _MOVED], -1, 0) - pivot
    turn = back[..., None] * _SHARES
    sin, cos = np.sin(turn), np.cos(turn)
    swung = cos * arm + sin * cross(axis, arm) + (1 - cos) * dot(axis, arm) * axis
    found = markers.copy()
    found[:, :, _MOVED] = np.moveaxis(swung + pivot, 0, -1)
    return found
