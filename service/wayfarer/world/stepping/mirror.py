"""Half of all agents live in a mirror: the model moves their mirror image.

A model prefers a side: it steps off with the right foot and swings the left arm wider, and a crowd
in which everybody does so marches. Bodies are symmetric, so the step of a mirror image, mirrored,
is a step of the agent, and as good as its own; over a crowd no side is preferred any more. Which
agents these are follows from their noise seeds, so the same seed still gives the same motion.
Bodies with MOJO's SSM2 are never mirrored: some of its markers have no counterpart.

The mirror is the plane x = 0 of the world.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body import landmarks, skeleton
from wayfarer.body.model import BodyModel
from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.process.compiled import compiled, warm
from wayfarer.spec import POSED_JOINTS
from wayfarer.world.output.legs import packed
from wayfarer.world.rows import Flags, Float

_SPREAD: Final = np.uint64(0x9E3779B97F4A7C15)
"""Spreads seeds that are near each other, as 1, 2, 3, over all bits (Fibonacci hashing)."""


def has_mirror_image(bodies: Iterable[BodyModel]) -> bool:
    """Whether the bodies' markers are ours, each of which has its counterpart."""
    return all(body.marker_names == landmarks.marker_names() for body in bodies)


def is_mirrored(noise_seed: NDArray[np.uint64]) -> Flags:
    """Whether each agent [A] moves in the mirror: half of all seeds, without a pattern."""
    flags: Flags = (noise_seed * _SPREAD) >> np.uint64(63) == 1
    return flags


def mirror_inputs(inputs: StepInputs, rows: Flags) -> StepInputs:
    """The inputs with `rows` [A] reflected; the others stay as they are."""
    if not rows.any():
        return inputs
    return replace(
        inputs,
        seed_markers=_reflected(inputs.seed_markers, rows, _MARKERS, _PLACE),
        seed_translation=_reflected(inputs.seed_translation, rows, _ONE, _PLACE),
        seed_rotations=_reflected(inputs.seed_rotations, rows, _JOINTS, _TURN),
        goal=_reflected(inputs.goal, rows, _ONE, _PLACE),
        facing=_reflected(inputs.facing, rows, _ONE, _PLACE[:2]),
        obstacles=_reflected(inputs.obstacles, rows, _ONE, _OBSTACLE),
    )


def mirror_outputs(outputs: StepOutputs, rows: Flags) -> StepOutputs:
    """The outputs of reflected inputs, in new arrays, with `rows` [A] back on this side."""
    return replace(
        outputs,
        translation=_reflected(outputs.translation, rows, _ONE, _PLACE),
        rotations=_reflected(outputs.rotations, rows, _JOINTS, _TURN),
        contacts=_reflected(outputs.contacts, rows, _FEET, -_PLACE[:1]),
        next_seed_markers=_reflected(outputs.next_seed_markers, rows, _MARKERS, _PLACE),
    )


def _pairs(names: Sequence[str], other: Callable[[str], str]) -> NDArray[np.int64]:
    return np.array([list(names).index(other(name)) for name in names])


_MARKERS: Final = _pairs(landmarks.marker_names(), landmarks.mirrored)
_JOINTS: Final = _pairs(skeleton.joint_names()[:POSED_JOINTS], skeleton.mirrored)
_FEET, _ONE = np.array([1, 0]), np.array([0])
"""Counterparts for pairs of two sides, and for single things."""

_PLACE: Final = np.array([-1, 1, 1], np.float32)
_TURN: Final = np.array([1, -1, -1, 1], np.float32)
_OBSTACLE: Final = np.array([-1, 1, -1, 1, -1, 1, 1], np.float32)
"""Signs of the components of a point or direction; of a rotation, of which the part about x and the
cosine stay; and of `StepInputs.obstacles`: ends and velocity."""


def _reflected(values: Float, rows: Flags, other: NDArray[np.int64], signs: Float) -> Float:
    """`values` [A, ..., P, D] with `rows` changed: each of the P becomes its counterpart."""
    found = np.empty(values.shape, np.float32)
    shape = len(rows), -1, len(other), len(signs)
    reflect(packed(values).reshape(shape), rows, other, signs, found.reshape(shape))
    return found


@compiled
def reflect(
    values: Float, rows: Flags, other: NDArray[np.int64], signs: Float, found: Float
) -> None:
    """See `_reflected`; values [A, M, P, D]."""
    for row in range(len(rows)):
        if not rows[row]:
            given, made = values[row].ravel(), found[row].ravel()
            for k in range(len(given)):
                made[k] = given[k]
            continue
        for group in range(values.shape[1]):
            for k in range(len(other)):
                for part in range(len(signs)):
                    found[row, group, k, part] = values[row, group, other[k], part] * signs[part]


@cache
def prepare() -> None:
    """Compiles the rule, or loads it, before agents walk."""
    values = np.zeros((1, 1, 1, 1), np.float32)
    warm(reflect, values, np.ones(1, np.bool_), _ONE, _PLACE[:1], values)
