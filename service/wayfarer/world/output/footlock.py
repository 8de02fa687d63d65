"""Foot lock: feet that bear weight stay where they are.

The model's feet slide: by 5 to 7 cm/s while it walks, 11 to 16 to the side and back. Here the slide
of a bearing foot is taken off frame by frame, as a *shift* of its ankle that two-bone inverse
kinematics carries out; while the foot swings, the shift fades away:

    contact   low and slow, with hysteresis; hold follows it within 3 frames
    shift     − grip · slide of the bearing point       a gripped foot stands still
              − (1 − grip) · FADE · shift               a free one returns to the model's place
    height    while in contact the lowest sole point settles on the floor, z = 0

The point that bears is the lowest of the sole (a soft minimum over heel, balls and toe), so a foot
rolls over its ball, and pivots about it. Only motion is taken off, never a place set, so nothing
jumps when the bearing point changes, at contact, or at a seam, over which the state carries the
shift. A shift that grows beyond a *leash*, or a foot that is pulled away fast, loosens the grip by
degrees. Feet keep their turn in the world.

This cleans what is sent and nothing else: the seeds of the next primitive stay the model's own, so
the lock cannot disturb the model. It acts in every frame. Pure functions; world space, metres, 40
frames per second.
"""

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer.world.output.legs import SOLES, Legs, pose_legs
from wayfarer.world.output.quaternion import Array, bounded, length, smooth
from wayfarer.world.output.twobone import MOVED, move_ankles
from wayfarer.world.rows import Flags, Float, Rows, Shape

TOUCH_HEIGHT: Final = 0.03
"""Metres: a lower and slower foot comes into contact."""

TOUCH_SPEED: Final = 0.4
"""Metres per second, horizontal, of the bearing point."""

LIFT_HEIGHT: Final = 0.05
"""A foot in contact that rises above this has left the floor."""

LIFT_SPEED: Final = 0.7
"""And so has one that is faster than this."""

TOLD_HEIGHT: Final = 0.02
"""Metres: a foot whose lowest point is sent higher than this is not told to be in contact."""

RISE: Final = np.float32(1 / 3)
"""Per frame: over 3 frames a hold rises, and falls."""

SLIPPING: Final = (0.25, LIFT_SPEED)
"""Metres per second: between these a foot tears itself loose by degrees."""

LEASH: Final = (0.09, 0.14)
"""Metres of horizontal shift between which the grip lets go by degrees: a foot that is pulled on
for long slides along with the body instead of snapping back."""

FADE: Final = 1 / (0.15 * FPS)
"""Share of its shift that a free foot loses in a frame: three quarters of it in 0.2 s."""

SETTLE: Final = 0.25
"""Share of a height error that is taken off in a frame. With 1, straight knees would shake."""

DROP: Final = 0.02
"""Metres: a foot in contact is pulled down less, the higher it is; from here on, not at all."""

SOFTNESS: Final = 0.001
"""Metres above the lowest sole point at which a point bears 1/e of what that one bears."""


@dataclass(slots=True)
class LockState(Rows):
    """What the lock remembers of two feet from one step to the next."""

    soles: Annotated[Float, Shape(2, SOLES, 3)]  # where the model had them in the last frame
    contact: Annotated[Flags, Shape(2)]
    hold: Annotated[Float, Shape(2)]  # 0…1, follows `contact`
    shift: Annotated[Float, Shape(2, 3)]  # how far the foot is moved


@dataclass(frozen=True, slots=True)
class Locked:
    """Cleaned frames."""

    rotations: Float  # [A, F, 22, 4]; hips, knees and ankles of both legs differ from the input
    contacts: Flags  # [A, F, 2] feet that are held and on the floor
    state: LockState


def begin(legs: Legs, translation: Float, rotations: Float) -> LockState:
    """The state before any motion, from a pose: translation [A, 3], rotations [A, 22, 4].

    Nothing is shifted; feet near the floor are held.
    """
    state = LockState.empty(len(translation))
    state.soles[:] = pose_legs(legs, translation[:, None], rotations[:, None]).soles[:, :, :, 0].T
    state.contact[:] = state.soles[..., 2].min(-1) < TOUCH_HEIGHT
    state.hold[:] = state.contact
    return state


def lock_feet(before: LockState, legs: Legs, translation: Float, rotations: Float) -> Locked:
    """Clean the next F frames of A agents: translation [A, F, 3], rotations [A, F, 22, 4].

    Many frames at once or in pieces, the result is the same; every agent's is its own.
    """
    pose = pose_legs(legs, translation, rotations)
    path = np.concatenate([before.soles.T[:, :, :, None], pose.soles], -2)  # [3, P, 2, 1 + F, A]
    height = pose.soles[2].min(0)
    slide = _slide(path, height)
    speed = FPS * length(slide)
    touches = (height < TOUCH_HEIGHT) & (speed < TOUCH_SPEED)
    stays = (height < LIFT_HEIGHT) & (speed < LIFT_SPEED)
    firmness = 1 - smooth(speed, *SLIPPING)
    settling = -height * (1 - smooth(height, 0, DROP))

    contact, hold, shift = before.contact.T, before.hold.T, before.shift.T
    shifts = np.empty((3, *height.shape), np.float32)
    held = np.empty(height.shape, np.bool_)
    for frame in range(height.shape[1]):
        contact = np.where(contact, stays[:, frame], touches[:, frame])
        hold = bounded(hold + np.where(contact, RISE, -RISE), 0, 1)
        grip = hold * firmness[:, frame] * (1 - smooth(length(shift[:2]), *LEASH))
        moved = shifts[:, :, frame]
        moved[:2] = (1 - (1 - grip) * FADE) * shift[:2] - grip * slide[:, :, frame]
        moved[2] = shift[2] + SETTLE * (hold * settling[:, frame] - shift[2])
        shift = moved
        held[:, frame] = contact & (grip >= 0.5) & (height[:, frame] + moved[2] <= TOLD_HEIGHT)

    cleaned = rotations.astype(np.float32)
    cleaned[:, :, MOVED] = move_ankles(pose, shifts)
    after = LockState(
        soles=path[:, :, :, -1].T, contact=contact.T, hold=hold.T, shift=shift.copy().T
    )
    return Locked(cleaned, held.T, after)


def _slide(path: Array, height: Array) -> Array:
    """Horizontal way of the bearing point since the last frame [2, 2, F, A].

    path [3, P, 2, 1 + F, A] of the sole points; height [2, F, A] of the lowest one.
    """
    load = np.exp((height - path[2, :, :, 1:]) / SOFTNESS)
    way: Array = (load * np.diff(path[:2], axis=-2)).sum(1) / load.sum(0)
    return way
