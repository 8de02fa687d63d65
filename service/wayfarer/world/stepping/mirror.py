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
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body import landmarks, skeleton
from wayfarer.body.model import BodyModel
from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.spec import POSED_JOINTS
from wayfarer.world.rows import Flags, Float

_SPREAD: Final = np.uint64(0x9E3779B97F4A7C15)
"""Spreads seeds that are near each other, as 1, 2, 3, over all bits (Fibonacci hashing)."""


def has_mirror_image(bodies: Iterable[BodyModel]) -> bool:
    """Whether the bodies' markers are ours, each of which has its counterpart."""
    return all(body.marker_names == landmarks.marker_names() for body in bodies)


def is_mirrored(noise_seed: NDArray[np.uint64]) -> Flags:
    """Which agents [A] are moved in the mirror: half of all seeds, without a pattern."""
    flags: Flags = (noise_seed * _SPREAD) >> np.uint64(63) == 1
    return flags


def mirror_inputs(inputs: StepInputs, rows: Flags) -> StepInputs:
    """The inputs with `rows` [A] reflected; the others stay as they are."""
    return replace(
        inputs,
        seed_markers=_put(inputs.seed_markers, rows, _of_markers),
        seed_translation=_put(inputs.seed_translation, rows, _flipped),
        seed_rotations=_put(inputs.seed_rotations, rows, _of_rotations),
        goal=_put(inputs.goal, rows, _flipped),
        facing=_put(inputs.facing, rows, _flipped),
        obstacles=_put(inputs.obstacles, rows, _of_obstacles),
    )


def mirror_outputs(outputs: StepOutputs, rows: Flags) -> StepOutputs:
    """The outputs of reflected inputs, with `rows` [A] back on this side of the mirror."""
    return replace(
        outputs,
        translation=_put(outputs.translation, rows, _flipped),
        rotations=_put(outputs.rotations, rows, _of_rotations),
        contacts=_put(outputs.contacts, rows, lambda feet: feet[..., ::-1]),
        next_seed_markers=_put(outputs.next_seed_markers, rows, _of_markers),
    )


def _pairs(names: Sequence[str], other: Callable[[str], str]) -> NDArray[np.int64]:
    return np.array([list(names).index(other(name)) for name in names])


_MARKERS: Final = _pairs(landmarks.marker_names(), landmarks.mirrored)
_JOINTS: Final = _pairs(skeleton.joint_names()[:POSED_JOINTS], skeleton.mirrored)


def _of_markers(markers: Float) -> Float:
    """[..., 67, 3]"""
    return _flipped(markers.take(_MARKERS, -2))


def _of_rotations(rotations: Float) -> Float:
    """[..., 22, 4]: the part about x and the cosine stay, those about y and z change sign."""
    return _negated(rotations.take(_JOINTS, -2), (1, 2))


def _flipped(points: Float) -> Float:
    """Points or directions [..., D] with their x negated."""
    return _negated(points, (0,))


def _of_obstacles(obstacles: Float) -> Float:
    """[..., 7] as in `StepInputs.obstacles`: ends and velocity."""
    return _negated(obstacles, (0, 2, 4))


def _negated(values: Float, components: Sequence[int]) -> Float:
    """The same array with some components negated, one after the other: each is an even stride."""
    for component in components:
        values[..., component] *= -1
    return values


def _put(values: Float, rows: Flags, change: Callable[[Float], Float]) -> Float:
    """`values` with `rows` changed; `change` may write into what it gets."""
    if not rows.any():
        return values
    which = np.flatnonzero(rows)
    changed = values.copy()
    changed[which] = change(values.take(which, 0))
    return changed
