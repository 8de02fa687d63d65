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
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.body import landmarks, skeleton
from wayfarer.body.model import BodyModel
from wayfarer.engines.engine import StepInputs
from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.spec import POSED_JOINTS
from wayfarer.world.output.legs import packed
from wayfarer.world.rows import Flags, Float, Index

_SPREAD: Final = np.uint64(0x9E3779B97F4A7C15)
"""Spreads seeds that are near each other, as 1, 2, 3, over all bits (Fibonacci hashing)."""


def has_mirror_image(bodies: Iterable[BodyModel]) -> bool:
    """Whether the bodies' markers are ours, each of which has its counterpart."""
    return all(body.marker_names == landmarks.marker_names() for body in bodies)


def is_mirrored(noise_seed: NDArray[np.uint64]) -> Flags:
    """Whether each agent [A] moves in the mirror: half of all seeds, without a pattern."""
    flags: Flags = (noise_seed * _SPREAD) >> np.uint64(63) == 1
    return flags


class Reflected(NamedTuple):
    """Inputs that are reflected, all with four axes: agents, groups, things with a counterpart on
    the other side, components.
    """

    markers: Float
    translation: Float
    rotations: Float
    goal: Float
    facing: Float
    obstacles: Float


def mirror_inputs(inputs: StepInputs, rows: Flags) -> StepInputs:
    """The inputs with `rows` [A] reflected; the others stay as they are."""
    if not rows.any():
        return inputs
    given = Reflected(
        packed(inputs.seed_markers),
        packed(inputs.seed_translation)[:, :, None],
        packed(inputs.seed_rotations),
        packed(inputs.goal)[:, None, None],
        packed(inputs.facing)[:, None, None],
        packed(inputs.obstacles)[:, :, None],
    )
    made = Reflected(*map(np.empty_like, given))
    _reflect_inputs(rows, given, made)
    return replace(
        inputs,
        seed_markers=made.markers,
        seed_translation=made.translation[:, :, 0],
        seed_rotations=made.rotations,
        goal=made.goal[:, 0, 0],
        facing=made.facing[:, 0, 0],
        obstacles=made.obstacles[:, :, 0],
    )


def _pairs(names: Sequence[str], other: Callable[[str], str]) -> NDArray[np.int64]:
    return np.array([list(names).index(other(name)) for name in names])


SIDES: Final = _pairs(landmarks.marker_names(), landmarks.mirrored)
JOINTS: Final = _pairs(skeleton.joint_names()[:POSED_JOINTS], skeleton.mirrored)
FEET, ONE = np.array([1, 0]), np.array([0])
"""Counterparts of markers and joints, for pairs of two sides, and for single things."""

PLACE: Final = np.array([-1, 1, 1], np.float32)
TURN: Final = np.array([1, -1, -1, 1], np.float32)
SAME: Final = np.array([1], np.float32)
_PLAN: Final = PLACE[:2].copy()
_OBSTACLE: Final = np.array([-1, 1, -1, 1, -1, 1, 1], np.float32)
"""Signs of the components of a point or direction, also in plan; of a rotation, of which the part
about x and the cosine stay; of a contact; and of `StepInputs.obstacles`: ends and velocity."""


@inner
def reflect(values: Float, row: int, flips: bool, other: Index, signs: Float, found: Float) -> None:
    """Writes a row of `values` [A, M, P, D] into `found`; if it flips, each of the P becomes its
    counterpart.
    """
    if not flips:
        given, made = values[row].ravel(), found[row].ravel()
        for k in range(len(given)):
            made[k] = given[k]
        return
    for group in range(values.shape[1]):
        for k in range(len(other)):
            at = other[k]
            for part in range(len(signs)):
                found[row, group, k, part] = values[row, group, at, part] * signs[part]


@compiled
def _reflect_inputs(rows: Flags, given: Reflected, made: Reflected) -> None:
    for row in range(len(rows)):
        flips = rows[row]
        reflect(given.markers, row, flips, SIDES, PLACE, made.markers)
        reflect(given.translation, row, flips, ONE, PLACE, made.translation)
        reflect(given.rotations, row, flips, JOINTS, TURN, made.rotations)
        reflect(given.goal, row, flips, ONE, PLACE, made.goal)
        reflect(given.facing, row, flips, ONE, _PLAN, made.facing)
        reflect(given.obstacles, row, flips, ONE, _OBSTACLE, made.obstacles)


@cache
def prepare() -> None:
    """Compiles the rule, or loads it, before agents walk."""
    given = Reflected(
        *(
            np.zeros((1, 1, len(other), len(signs)), np.float32)
            for other, signs in (
                (SIDES, PLACE),
                (ONE, PLACE),
                (JOINTS, TURN),
                (ONE, PLACE),
                (ONE, _PLAN),
                (ONE, _OBSTACLE),
            )
        )
    )
    warm(_reflect_inputs, np.zeros(1, np.bool_), given, given)
