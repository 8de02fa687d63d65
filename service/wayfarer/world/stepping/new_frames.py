"""New frames of a step after the engine: checked, and corrected rule by rule.

Each is one compiled call for all agents of a batch; rows do not influence each other. World space,
metres, 40 frames per second.
"""

from collections.abc import Sequence
from functools import cache
from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.engines.engine import StepOutputs
from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.spec import MARKERS, NEW_FRAMES, POSED_JOINTS
from wayfarer.world.agents.slots import Seeds
from wayfarer.world.output.footlock import Planted, lock_rows
from wayfarer.world.output.legs import Bones, Legs, bones, packed
from wayfarer.world.rows import Flags, Float, Int8
from wayfarer.world.stepping.guards import bear_rows, bend_rows
from wayfarer.world.stepping.righting import Step, right_rows

MAX_STEP_METRES: Final = 3.0
"""A body that moves farther in one step (15 m/s) has exploded."""

CORRECTIONS: Final = ("guards", "righting", "foot lock")
"""Names of the rules that correct frames, in their order; see rules.py."""


class NewFrames(NamedTuple):
    """New frames, in arrays that the rules may change."""

    translation: Float  # [A, F, 3] hips
    rotations: Float  # [A, F, 22, 4]
    contacts: Flags  # [A, F, 2] feet on the floor
    markers: Float  # [A, S, 67, 3] of the last S frames


def broken(start: Float, outputs: StepOutputs) -> Flags:
    """Rows [A] that cannot be shown: not finite, or with hips far off `start` [A, 3]."""
    found = np.empty(len(start), np.bool_)
    turns, markers = packed(outputs.rotations), packed(outputs.next_seed_markers)
    _break(packed(start), packed(outputs.translation), turns, markers, found)
    return found


def corrected(
    acting: Sequence[str],
    mode: Int8,
    legs: Legs,
    lock: tuple[Flags, Float],
    seed: Seeds,
    frames: NewFrames,
) -> tuple[Flags, Float, Float]:
    """Changes `frames` of A agents by the `acting` ones of `CORRECTIONS`. Returns which of them had
    a knee beyond its limits, and their posture at the end; see `bear_rows`.

    `mode` is theirs during the step, `seed` the frames before it. `lock`: which agents want the
    foot lock [A], and how far markers follow legs (see footlock.py).
    """
    acts = tuple(name in acting for name in CORRECTIONS)
    mended, (upright, hips) = np.zeros(len(mode), np.bool_), np.empty((2, len(mode)), np.float32)
    before = packed(seed.translation), packed(seed.rotations)
    _correct(acts, mode, bones(legs), lock, before, frames, mended, upright, hips)
    return mended, upright, hips


@compiled
def _correct(
    acts: tuple[bool, bool, bool],
    mode: Int8,
    legs: Bones,
    lock: tuple[Flags, Float],
    before: tuple[Float, Float],
    frames: NewFrames,
    mended: Flags,
    upright: Float,
    hips: Float,
) -> None:
    translation, rotations, contacts, markers = frames
    if acts[0]:
        bend_rows(rotations, legs.ankle, mended)
    if acts[1]:
        right_rows(mode, Step(translation, rotations, markers))
    if acts[2]:
        step = Planted(rotations, markers, contacts)
        lock_rows(lock[0], legs, lock[1], before[0], before[1], translation, step)
    bear_rows(translation, rotations, legs, upright, hips)


@compiled
def _break(start: Float, translation: Float, turns: Float, markers: Float, found: Flags) -> None:
    for row in range(len(found)):
        whole = _finite(turns[row]) and _finite(markers[row])
        for frame in range(translation.shape[1]):
            x = translation[row, frame, 0] - start[row, 0]
            y = translation[row, frame, 1] - start[row, 1]
            z = translation[row, frame, 2] - start[row, 2]
            whole = whole and sqrt(x * x + y * y + z * z) <= MAX_STEP_METRES
        found[row] = not whole


@inner
def _finite(values: Float) -> bool:
    whole, flat = True, values.ravel()
    for k in range(len(flat)):
        whole &= abs(flat[k]) < np.inf
    return whole


@cache
def prepare() -> None:
    """Compiles the rules, or loads them, before agents walk."""
    some, row = np.zeros(1, np.bool_), np.zeros(1, np.float32)
    hips, turns = np.zeros((1, NEW_FRAMES, 3), np.float32), Seeds.empty(1).rotations
    markers = Seeds.empty(1).markers
    warm(_break, hips[:, 0], hips, turns, markers, some)
    turns = np.ones((1, NEW_FRAMES, POSED_JOINTS, 4), np.float32)
    frames = NewFrames(hips, turns, np.zeros((1, NEW_FRAMES, 2), np.bool_), markers)
    lock = some, np.zeros((MARKERS, 2, 2), np.float32)
    acts, mode, legs = (True, True, True), np.zeros(1, np.int8), bones(Legs.empty(1))
    warm(_correct, acts, mode, legs, lock, (hips, turns), frames, some, row, row)
