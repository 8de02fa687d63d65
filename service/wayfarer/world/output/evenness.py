"""Steps as long as the way of the hips, and left ones as long as right ones.

Both move the ankles along the facing of the hips, before feet are locked.
"""

from typing import Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer.world.output.legs import Legs, pose_legs
from wayfarer.world.output.quaternion import Array, bounded
from wayfarer.world.output.twobone import MOVED, move_ankles
from wayfarer.world.rows import Flags, Float

EVEN: Final = 1 / (1.3 * FPS)
"""Share by which feet are moved in a frame towards where left and right steps are as long …"""

EVEN_MOST: Final = 0.05
"""… and metres at most: the model's walkers limp, people hardly do."""

FORGET: Final = 0.025 / FPS
"""Metres by which the longest step that is remembered of either foot shrinks in a frame."""

_SIDES: Final = np.array([1.0, -1.0], np.float32)[:, None, None]
"""Left and right foot."""


def shorten_steps(
    legs: Legs, translation: Float, rotations: Float, before: Float, after: Float
) -> Float:
    """Rotations [A, F, 22, 4] of frames whose feet are not locked, with steps as long as the way of
    the hips: that has been shortened by these shares [A] before the first and at the last of them.
    """
    pose = pose_legs(legs, translation, rotations)
    along = (pose.ankle[:2] * pose.facing).sum(0)
    shift = np.zeros(pose.ankle.shape, np.float32)
    if (drawn := draw_in(along, pose.facing, before, after, np.zeros_like(along[0]))) is not None:
        shift[:2] = drawn
    found = rotations.astype(np.float32)
    found[:, :, MOVED] = move_ankles(pose, shift)
    return found


def even_steps(reach: Array, moved: Array, along: Array, steps: Flags) -> tuple[Array, Array]:
    """How far each foot gets ahead of the other [2, F, A], and metres [F, A] that the left one is
    moved ahead by, and the right one back, so that it is as far: of ankles `along` [2, F, A] the
    facing. `reach` [2, A] and `moved` [A] are those of the frame before.
    """
    lead = along[0] - along[1]
    evened = np.empty(lead.shape, np.float32)
    reaches = np.empty(along.shape, np.float32)
    share = np.where(steps, 0, EVEN).astype(np.float32)  # feet that stand are not moved for it
    leads = np.stack([lead, -lead], 1)  # [F, 2, A]
    for frame, ahead in enumerate(leads):
        reach = np.maximum(reach - FORGET, ahead)
        reaches[:, frame] = reach
        wanted = bounded((reach[1] - reach[0]) / 4, -EVEN_MOST, EVEN_MOST)
        moved = moved + share * (wanted - moved)
        evened[frame] = moved
    return reaches, evened


def draw_in(
    along: Array, facing: Array, before: Float, after: Float, evened: Array
) -> Array | None:
    """Way [2, 2, F, A] of ankles, `along` [2, F, A] the `facing` of the hips, where steps are
    shortened by these shares [A] and `evened` [F, A]. None: nobody's are.
    """
    if not (before.any() or after.any() or evened.any()):
        return None
    frames = along.shape[1]
    rise = np.arange(1, frames + 1, dtype=np.float32)[:, None] / frames
    drawn: Array = (_SIDES * evened - (before + rise * (after - before)) * along) * facing
    return drawn
