"""Corrective steps: feet of who stands or turns on the spot are lifted and set down elsewhere.

A foot that has come too far from where the model has it sets out, one foot after the other, and
lands where the model will have it then. `footlock.py` moves the feet; here is when, where to and
how high. Feet first, left and right; positions and turns as in `footlock.LockState`.
"""

from math import radians
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS
from wayfarer.world.output.quaternion import Array, bounded, length, smooth
from wayfarer.world.rows import Flags

STEP_FRAMES: Final = 12
"""Frames of a corrective step: 0.3 s."""

STEP_HEIGHT: Final = 0.05
"""Metres that it lifts the foot by."""

FLIGHT: Final = (0.15, 0.85)
"""Shares of a step between which the foot is high enough to move over the floor."""

STEP_SHIFT: Final = 0.05
"""Metres from the model's place beyond which a foot steps …"""

STEP_TURN: Final = radians(24)
"""… and radians from the model's turn."""

STEP_AHEAD: Final = 0.15
"""Seconds: a foot is set down where the model will have it then, at its speed now."""

AHEAD_SHIFT: Final = 0.10
"""Metres that this may be at most, …"""

AHEAD_TURN: Final = radians(20)
"""… and radians."""

AIM: Final = 0.2
"""Share by which the landing follows that place in a frame: the model's speed may change at once,
a foot in the air does not."""

TIDY: Final = 0.8
"""Share of those bounds from which a foot steps when the model has come to rest."""

PATIENT: Final = 1.6
"""Share from which it steps before that if somebody stands: where a foot is to be is only known
when the model's feet rest, and one that sets out earlier has to be set down again."""

LEADING: Final = 0.25
"""Share of those bounds by which the inner or leading foot is preferred."""

APART: Final = 0.11
"""Metres between the middles of the soles, aside: nearer to each other no foot is set down."""

RESTING: Final = (0.03, radians(12))
"""Metres and radians per second below which it has."""


def plan_landings(slide: Array, turning: Array) -> tuple[Array, Flags]:
    """Where a foot that steps now is to land, ahead of the model: shift (x, y) and turn
    [3, 2, F, A]; and whether the model's feet rest [F, A].
    """
    way, speed = STEP_AHEAD * FPS * slide, FPS * length(slide)
    shift = way * np.minimum(1, AHEAD_SHIFT / np.maximum(STEP_AHEAD * speed, 1e-9))
    turn = bounded(STEP_AHEAD * FPS * turning, -AHEAD_TURN, AHEAD_TURN)
    slow, quiet = RESTING
    rests: Flags = np.all((speed < slow) & (FPS * np.abs(turning) < quiet), axis=0)
    return np.concatenate([shift, turn[None]]), rests


def set_out(
    swing: NDArray[np.int8], may: Flags, shift: Array, turn: Array, bound: Array, across: Array
) -> NDArray[np.int8]:
    """Frames left of each foot's step [2, A]: one foot of those that `may` sets out if it is due,
    from `bound` [A] on.

    The foot that is farther from its place, while both bear. Of feet about as far away the inner
    one goes first in a turn, and the leading one aside; across [2, A] points from left to right.
    """
    error = np.maximum(length(shift[:2]) / STEP_SHIFT, np.abs(turn) / STEP_TURN)
    lag = ((shift[:2, 0] + shift[:2, 1]) * across).sum(0) / STEP_SHIFT
    to_left = lag - (turn[0] + turn[1]) / STEP_TURN
    left_first = error[0] + np.where(to_left > 0, LEADING, -LEADING) >= error[1]
    free = may[0] & may[1] & (swing[0] == 0) & (swing[1] == 0)
    sets_out = free & (error > bound)
    sets_out[0] &= left_first
    sets_out[1] &= ~left_first
    return np.where(sets_out, np.int8(STEP_FRAMES), swing)


def uncrossed(goals: Array, shift: Array, between: Array, across: Array) -> Array:
    """Landings [2, 2, A] at which a foot does not come nearer to the other one than `APART`.

    The model has the feet `between` [A] metres apart in the direction `across` [2, A].
    """
    left = APART - between - ((shift[:2, 1] - goals[:, 0]) * across).sum(0)
    right = APART - between - ((goals[:, 1] - shift[:2, 0]) * across).sum(0)
    moved = goals.copy()
    moved[:, 0] -= np.maximum(left, 0) * across
    moved[:, 1] += np.maximum(right, 0) * across
    return moved


def _step_tables() -> tuple[Flags, Array, Array]:
    """From the remaining frames of a step: whether the foot flies in the next frame, the share of
    its shift and turn that stays then, and the metres that it is raised by.

    It moves and turns in the air: not while it is lifted, nor while it is set down.
    """
    frames = np.arange(STEP_FRAMES + 1)
    left = smooth(frames / STEP_FRAMES, *FLIGHT)
    later = np.concatenate([[0.0], left[:-1]])
    flies = (left > 0) & (later < 1)
    kept = np.where(flies, later / np.maximum(left, 1e-6), 1.0)
    lift = STEP_HEIGHT * np.sin(np.pi * frames / STEP_FRAMES) ** 2
    return flies, kept.astype(np.float32), lift.astype(np.float32)


FLIES, KEPT, LIFT = _step_tables()
"""By the frames that a step still takes, 0 … `STEP_FRAMES`."""
