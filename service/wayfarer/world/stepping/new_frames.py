"""New frames of a step after the engine: back from the mirror, and corrected rule by rule.

Each of the two functions is one compiled call for all agents of a batch; rows do not influence each
other. World space, metres, 40 frames per second.
"""

from dataclasses import replace
from functools import cache
from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.engines.engine import StepOutputs
from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.spec import MARKERS, NEW_FRAMES, POSED_JOINTS, SEED_FRAMES
from wayfarer.world.agents.slots import Seeds
from wayfarer.world.output.footlock import Planted, lock_rows
from wayfarer.world.output.legs import Bones, Legs, bones, packed
from wayfarer.world.rows import Flags, Float, Int8
from wayfarer.world.stepping.guards import bear_rows, bend_rows
from wayfarer.world.stepping.mirror import FEET, JOINTS, ONE, PLACE, SAME, SIDES, TURN, reflect
from wayfarer.world.stepping.righting import Step, right_rows

MAX_STEP_METRES: Final = 3.0
"""A body that moves farther in one step (15 m/s) has exploded."""

CORRECTIONS: Final = ("guards", "righting", "foot lock")
"""Names of the rules that correct frames, in their order; see rules.py."""


class Frames(NamedTuple):
    """New frames, in arrays of their own, which the rules change."""

    translation: Float  # [A, F, 3] hips
    rotations: Float  # [A, F, 22, 4]
    contacts: Flags  # [A, F, 2] feet on the floor
    markers: Float  # [A, S, 67, 3] of the last S frames


class Corrected(NamedTuple):
    """What the rules found."""

    mended: Flags  # [A] with a joint beyond a body's limits
    upright: Float  # [A] cosine of the lean at the end; see guards.py
    hips: Float  # [A] their height then, as a share of that in a stand


class Acts(NamedTuple):
    """Which of `CORRECTIONS` act."""

    guards: bool
    righting: bool
    foot_lock: bool


class Engine(NamedTuple):
    """An engine's arrays, all with four axes: agents, groups, things with a counterpart on the
    other side, components.
    """

    translation: Float
    rotations: Float
    contacts: Float
    markers: Float


def received(outputs: StepOutputs, mirrored: Flags, start: Float) -> tuple[StepOutputs, Flags]:
    """The outputs in arrays of their own, rows in `mirrored` [A] back on this side of the mirror,
    and the rows [A] that cannot be shown: not finite, or with hips far off `start` [A, 3].
    """
    given = Engine(
        packed(outputs.translation)[:, :, None],
        packed(outputs.rotations),
        packed(outputs.contacts)[..., None],
        packed(outputs.next_seed_markers),
    )
    made, broken = Engine(*map(np.empty_like, given)), np.empty(len(start), np.bool_)
    _receive(given, mirrored, packed(start), made, broken)
    found = replace(
        outputs,
        translation=made.translation[:, :, 0],
        rotations=made.rotations,
        contacts=made.contacts[..., 0],
        next_seed_markers=made.markers,
    )
    return found, broken


def corrected(
    acts: Acts, mode: Int8, legs: Legs, lock: tuple[Flags, Float], seed: Seeds, frames: Frames
) -> Corrected:
    """Changes `frames` of A agents by the rules in `acts`.

    `mode` is theirs during the step, `seed` the frames before it, and `lock` who wants the foot
    lock [A], and how far markers follow legs (see footlock.py).
    """
    count = len(mode)
    found = Corrected(
        np.zeros(count, np.bool_), np.empty(count, np.float32), np.empty(count, np.float32)
    )
    before = packed(seed.translation), packed(seed.rotations)
    _correct(acts, mode, bones(legs), lock, before, frames, found)
    return found


@compiled
def _receive(given: Engine, mirrored: Flags, start: Float, made: Engine, broken: Flags) -> None:
    for row in range(len(mirrored)):
        flips = mirrored[row]
        reflect(given.translation, row, flips, ONE, PLACE, made.translation)
        reflect(given.rotations, row, flips, JOINTS, TURN, made.rotations)
        reflect(given.contacts, row, flips, FEET, SAME, made.contacts)
        reflect(given.markers, row, flips, SIDES, PLACE, made.markers)
        whole = _finite(made.rotations[row]) and _finite(made.markers[row])
        for frame in range(made.translation.shape[1]):
            x = made.translation[row, frame, 0, 0] - start[row, 0]
            y = made.translation[row, frame, 0, 1] - start[row, 1]
            z = made.translation[row, frame, 0, 2] - start[row, 2]
            whole = whole and sqrt(x * x + y * y + z * z) <= MAX_STEP_METRES
        broken[row] = not whole


@compiled
def _correct(
    acts: Acts,
    mode: Int8,
    legs: Bones,
    lock: tuple[Flags, Float],
    before: tuple[Float, Float],
    frames: Frames,
    found: Corrected,
) -> None:
    translation, rotations, contacts, markers = frames
    if acts.guards:
        bend_rows(rotations, legs.ankle, found.mended)
    if acts.righting:
        right_rows(mode, Step(translation, rotations, markers))
    if acts.foot_lock:
        step = Planted(rotations, markers, contacts)
        lock_rows(lock[0], legs, lock[1], before[0], before[1], translation, step)
    bear_rows(translation, rotations, legs, found.upright, found.hips)


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
    frames = Frames(
        np.zeros((1, NEW_FRAMES, 3), np.float32),
        np.ones((1, NEW_FRAMES, POSED_JOINTS, 4), np.float32),
        np.zeros((1, NEW_FRAMES, 2), np.bool_),
        np.zeros((1, SEED_FRAMES, MARKERS, 3), np.float32),
    )
    floats = np.zeros((1, NEW_FRAMES, 2), np.float32)
    made = StepOutputs(frames[0], frames[1], floats, frames[3], floats, np.zeros(1, np.int64))
    received(made, some, frames.translation[:, 0])
    lock = some, np.zeros((MARKERS, 2, 2), np.float32)
    before, found = (frames.translation, frames.rotations), Corrected(some, row, row)
    acts, mode = Acts(True, True, True), np.zeros(1, np.int8)
    warm(_correct, acts, mode, bones(Legs.empty(1)), lock, before, frames, found)
