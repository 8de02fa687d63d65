"""Straightens up leaning bodies, which nothing else does.

The model continues from a person's stand, and nothing in it penalises leaning; docs/models.md has
how many people fell without this rule. Every step removes a part of the lean beyond `MOST`, or
`MOST_ON_THE_SPOT`, with a rotation of the spine that is spread over the new frames. The markers
from which the next step starts get the same rotation, and the next primitive follows them.

World space, metres, radians. Pure functions of columns: rows do not influence each other.
"""

from math import atan2, cos, radians, sin, sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.body.landmarks import marker_names
from wayfarer.process.compiled import compiled, inner
from wayfarer.spec import NEW_FRAMES, SEED_FRAMES
from wayfarer.world.agents.slots import Mode
from wayfarer.world.output.turns import (
    Vector,
    about,
    add,
    inverse,
    less,
    multiply,
    put,
    put_vector,
    rotate,
    turn,
    vector,
)
from wayfarer.world.rows import Float, Int8
from wayfarer.world.stepping.guards import SPINE, spine_up

EASE: Final = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, NEW_FRAMES + 1) / NEW_FRAMES)
"""Share of the rotation in each new frame: nothing at the seam, all of it at the end."""


class Step(NamedTuple):
    """New frames of a step, and the markers from which the next one starts."""

    translation: Float  # [A, F, 3] hips
    rotations: Float  # [A, F, 22, 4]
    markers: Float  # [A, S, 67, 3] of the last S frames


MOST: Final = radians(14)
MOST_ON_THE_SPOT: Final = radians(9)
"""Lean of the spine, in any direction, that is allowed: for walkers, and for all others."""

SHARE: Final = 0.35
"""Share of the lean beyond it that a step removes."""

TURN_MOST: Final = radians(5)
"""Maximum radians of lean that a step removes."""

PIVOT: Final = 0.21
"""Metres above the hips joint about which the spine bends as a whole."""

_BELOW: Final = (
    "FWT", "BWT", "HIP", "THI", "KNE", "KNI", "SHN", "CLF", "ANK", "HEE", "TOE", "MT1", "MT5",
)  # fmt: skip
"""Markers of hips and legs, without their sides."""


def _share(marker: str) -> float:
    """Multiple of the spine's rotation that a marker follows. Each joint of the spine turns by half
    of the spine's mean rotation.
    """
    if marker[1:] in _BELOW or "SOLE" in marker:
        return 0
    return {"LNWST": 0.5, "RNWST": 0.5, "T10": 1}.get(marker, 1.5)


SHARES: Final = np.array([_share(name) for name in marker_names()])

WALKS: Final = np.array([mode in (Mode.WALKING, Mode.STOPPING, Mode.STRAFING) for mode in Mode])
"""Whether an agent may lean as walkers do, by mode."""


@compiled
def right_rows(mode: Int8, step: Step) -> None:
    """Removes a part of the lean by the step's end for agents [A] that lean too far; `mode` is
    theirs during it. The others are unchanged.
    """
    for row in range(len(mode)):
        up = spine_up(step.rotations, row)
        aside = sqrt(up[0] * up[0] + up[1] * up[1])
        excess = atan2(aside, up[2]) - (MOST if WALKS[mode[row]] else MOST_ON_THE_SPOT)
        if excess <= 0:
            continue
        wide = max(aside, 1e-6)
        axis = up[1] / wide, -up[0] / wide, 0.0  # about which the spine straightens up
        back = min(SHARE * excess, TURN_MOST)
        for frame in range(NEW_FRAMES):
            seed = frame - (NEW_FRAMES - SEED_FRAMES)
            if seed >= 0:
                hips = turn(step.rotations, (row, frame, 0))
                above = rotate(hips, (0.0, 0.0, PIVOT))
                pivot = add(vector(step.translation, (row, frame)), above)
                _swing(step.markers, row, seed, pivot, axis, back * EASE[frame])
            _bend_back(step.rotations, row, frame, axis, back * EASE[frame])


@inner
def _bend_back(rotations: Float, row: int, frame: int, axis: Vector, back: float) -> None:
    """Rotates the spine in rotations [A, F, 22, 4] by a mean of `back` radians about the world's
    `axis`.
    """
    above = turn(rotations, (row, frame, 0))
    sine, cosine = sin(back / 4), cos(back / 4)
    for joint in SPINE:
        local = turn(rotations, (row, frame, joint))
        more = about(rotate(inverse(above), axis), sine, cosine)
        put(rotations, (row, frame, joint), multiply(more, local))
        above = multiply(above, local)


@inner
def _swing(markers: Float, row: int, frame: int, pivot: Vector, axis: Vector, back: float) -> None:
    """Rotates the markers [A, S, 67, 3] above the hips by `back` about `axis` through `pivot`."""
    for marker in range(len(SHARES)):
        if SHARES[marker] > 0:
            half = back * SHARES[marker] / 2
            at = row, frame, marker
            arm = less(vector(markers, at), pivot)
            swung = rotate(about(axis, sin(half), cos(half)), arm)
            put_vector(markers, at, add(pivot, swung))
