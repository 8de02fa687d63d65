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
from functools import cache
from math import exp, sqrt
from typing import Annotated, Final, NamedTuple

import numpy as np

from wayfarer.compiled import compiled, warm
from wayfarer.spec import FPS, POSED_JOINTS
from wayfarer.world.output.legs import SOLES, Bones, Legs, bones, packed, pose_leg, sole_point
from wayfarer.world.output.turns import less, put_vector, smooth, vector
from wayfarer.world.output.twobone import move_ankle, put_leg
from wayfarer.world.rows import Double, Flags, Float, Rows, Shape

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

RISE: Final = 1 / 3
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

LEAST_LOAD: Final = -40
"""Exponent of the smallest load that counts; a smaller one is lost in rounding."""


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


class _Feet(NamedTuple):
    """The columns of `LockState`, for compiled rules."""

    soles: Float
    contact: Flags
    hold: Float
    shift: Float


def begin(legs: Legs, translation: Float, rotations: Float) -> LockState:
    """The state before any motion, from a pose: translation [A, 3], rotations [A, 22, 4].

    Nothing is shifted; feet near the floor are held.
    """
    state = LockState.empty(len(translation))
    _begin(_feet(state), bones(legs), packed(translation[:, None]), packed(rotations[:, None]))
    return state


def lock_feet(before: LockState, legs: Legs, translation: Float, rotations: Float) -> Locked:
    """Clean the next F frames of A agents: translation [A, F, 3], rotations [A, F, 22, 4].

    Many frames at once or in pieces, the result is the same; every agent's is its own.
    """
    after = before.take(np.arange(len(rotations)))
    cleaned = np.array(rotations, np.float32, order="C")
    held = np.empty((*rotations.shape[:2], 2), np.bool_)
    _lock(_feet(after), bones(legs), packed(translation), cleaned, held)
    return Locked(cleaned, held, after)


@cache
def prepare() -> None:
    """Compile the lock, or load it, before anybody walks."""
    feet, legs = _feet(LockState.empty(1)), bones(Legs.empty(1))
    hips, turns = np.zeros((1, 1, 3), np.float32), np.ones((1, 1, POSED_JOINTS, 4), np.float32)
    warm(_begin, feet, legs, hips, turns)
    warm(_lock, feet, legs, hips, turns, np.empty((1, 1, 2), np.bool_))


def _feet(state: LockState) -> _Feet:
    return _Feet(state.soles, state.contact, state.hold, state.shift)


@compiled
def _begin(feet: _Feet, legs: Bones, translation: Float, rotations: Float) -> None:
    for row in range(len(rotations)):
        for foot in range(2):
            leg, height = pose_leg(legs, row, 0, foot, rotations), np.inf
            for point in range(SOLES):
                sole = sole_point(legs, row, foot, point, leg, vector(translation, (row, 0)))
                put_vector(feet.soles, (row, foot, point), sole)
                height = min(height, sole[2])
            feet.contact[row, foot] = height < TOUCH_HEIGHT
            feet.hold[row, foot] = 1.0 if height < TOUCH_HEIGHT else 0.0


@compiled
def _lock(feet: _Feet, legs: Bones, translation: Float, rotations: Float, held: Flags) -> None:
    """Into `feet`, `rotations` and `held` [A, F, 2]."""
    was, now = np.empty((SOLES, 3)), np.empty((SOLES, 3))
    for row in range(len(rotations)):
        for foot in range(2):
            for point in range(SOLES):
                put_vector(was, (point,), vector(feet.soles, (row, foot, point)))
            contact, hold = feet.contact[row, foot], float(feet.hold[row, foot])
            x, y, z = vector(feet.shift, (row, foot))
            for frame in range(rotations.shape[1]):
                leg = pose_leg(legs, row, frame, foot, rotations)
                height, root = np.inf, vector(translation, (row, frame))
                for point in range(SOLES):
                    sole = sole_point(legs, row, foot, point, leg, root)
                    put_vector(now, (point,), sole)
                    height = min(height, sole[2])
                slide_x, slide_y = _slide(was, now, height)
                speed = FPS * sqrt(slide_x * slide_x + slide_y * slide_y)
                if contact:
                    contact = height < LIFT_HEIGHT and speed < LIFT_SPEED
                else:
                    contact = height < TOUCH_HEIGHT and speed < TOUCH_SPEED
                hold = min(hold + RISE, 1.0) if contact else max(hold - RISE, 0.0)
                firmness = 1 - smooth(speed, SLIPPING[0], SLIPPING[1])
                grip = hold * firmness * (1 - smooth(sqrt(x * x + y * y), LEASH[0], LEASH[1]))
                settling = -height * (1 - smooth(height, 0.0, DROP))
                kept = 1 - (1 - grip) * FADE
                x, y = kept * x - grip * slide_x, kept * y - grip * slide_y
                z += SETTLE * (hold * settling - z)
                held[row, frame, foot] = contact and grip >= 0.5 and height + z <= TOLD_HEIGHT
                made = move_ankle(
                    leg.root_turn,
                    leg.hip_turn,
                    leg.knee_turn,
                    leg.ankle_turn,
                    less(leg.knee, leg.hip),
                    less(leg.ankle, leg.knee),
                    (x, y, z),
                )
                put_leg(rotations, row, frame, foot, made)
                for point in range(SOLES):
                    put_vector(was, (point,), vector(now, (point,)))
            for point in range(SOLES):
                put_vector(feet.soles, (row, foot, point), vector(was, (point,)))
            feet.contact[row, foot], feet.hold[row, foot] = contact, hold
            put_vector(feet.shift, (row, foot), (x, y, z))


@compiled
def _slide(was: Double, now: Double, height: float) -> tuple[float, float]:
    """Horizontal way of the bearing point since the last frame, of sole points [P, 3]; `height`
    of the lowest one.
    """
    total, x, y = 0.0, 0.0, 0.0
    for point in range(SOLES):
        over = (height - now[point, 2]) / SOFTNESS
        if over > LEAST_LOAD:
            load = exp(over)
            total += load
            x += load * (now[point, 0] - was[point, 0])
            y += load * (now[point, 1] - was[point, 1])
    return x / total, y / total
