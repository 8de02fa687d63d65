"""Foot lock: feet that bear weight stay where they are.

The model's feet slide by a few cm/s. Here the slide of a bearing foot is taken off frame by frame,
as a *shift* of its ankle that two-bone inverse kinematics carries out; while the foot swings, the
shift fades away:

    contact   low and slow, with hysteresis; hold follows it within 3 frames
    shift     − grip · slide of the bearing point       a gripped foot stands still
              − (1 − grip) · FADE · shift               a free one returns to the model's place
    height    while in contact the lowest sole point settles on the floor, z = 0
    limp      left and right steps become as long: of who walks one foot is moved ahead, the other
              one back (`evenness.py`)

An agent that stands or turns on the spot *steps*: the lock keeps the turn of its feet, too, and a
foot that has come too far from where the model has it is lifted and set down there a moment later,
one foot after the other (`footsteps.py`). So a body that turns, or is moved, takes its feet along
as people do.

The hips rise, fall and sway a little more than the model's do, while a foot bears: see `hips.py`.

The point that bears is the lowest of the sole (a soft minimum over heel, balls and toe), so a foot
rolls over its ball. Only motion is taken off, never a place set, so nothing jumps when the bearing
point changes, at contact, or at a seam, over which the state carries the shift. A shift that grows
beyond a *leash*, or a foot that is pulled away fast, loosens the grip by degrees. Feet keep their
turn in the world.

This cleans what is sent and nothing else: the seeds of the next primitive stay the model's own, so
the lock cannot disturb the model. Pure functions; world space, metres, 40 frames per second.
"""

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer.world.output.evenness import draw_in, even_steps
from wayfarer.world.output.footsteps import (
    AIM,
    FLIES,
    KEPT,
    LIFT,
    PATIENT,
    TIDY,
    plan_landings,
    set_out,
    uncrossed,
)
from wayfarer.world.output.hips import STRAIGHTENED, lower_hips, sway_hips
from wayfarer.world.output.legs import SOLES, Legs, pose_legs
from wayfarer.world.output.quaternion import Array, bounded, length, smooth
from wayfarer.world.output.twobone import FREE, MOVED, move_feet
from wayfarer.world.rows import Flags, Float, Int8, Rows, Shape

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

LEASH: Final = (0.07, 0.10)
"""Metres of horizontal shift between which the grip lets go by degrees: a foot that is pulled on
for long slides along with the body instead of snapping back."""

FADE: Final = 1 / (0.15 * FPS)
"""Share of its shift that a free foot loses in a frame: three quarters of it in 0.2 s."""

SETTLE: Final = 0.25
"""Share of a height error that is taken off in a frame. With 1, straight knees would shake."""

DROP: Final = 0.02
"""Metres: a foot in contact is pulled down less, the higher it is; from here on, not at all."""

AIRBORNE: Final = (0.0, 0.15)
"""Metres of the lower sole's height between which feet bear less and less: runners are in the air
for a moment, and a foot that is no longer lowered all at once jumps."""

KICK: Final = 0.485
"""Share that is taken off what an ankle is higher than …"""

KICKED: Final = (0.05, 0.22)
"""… the first of these, by degrees up to the second, in metres, while the other foot bears: the
model's walkers kick up their heels. Nothing is taken off …"""

SPARED: Final = 0.5
"""And no more than this share of what the leg could be longer."""

CLEAR: Final = (TOLD_HEIGHT, 0.08)
"""… while its sole is lower than the first of these, and all of it from the second on."""

SOFTNESS: Final = 0.001
"""Metres above the lowest sole point at which a point bears 1/e of what that one bears."""


@dataclass(slots=True)
class LockState(Rows):
    """What the lock remembers of two feet from one step to the next."""

    soles: Annotated[Float, Shape(2, SOLES, 3)]  # where the model had them in the last frame
    contact: Annotated[Flags, Shape(2)]
    hold: Annotated[Float, Shape(2)]  # 0…1, follows `contact`
    shift: Annotated[Float, Shape(2, 3)]  # how far the foot is moved
    turn: Annotated[Float, Shape(2)]  # radians that it is turned by, about the vertical
    aim: Annotated[Float, Shape(2, 3)]  # shift and turn at which a step would land
    swing: Annotated[Int8, Shape(2)]  # frames that its corrective step still takes; 0: none
    shortened: Float  # share that the last step was shortened by
    reach: Annotated[Float, Shape(2)]  # metres that each foot gets ahead of the other
    evened: Float  # metres that the left foot is moved ahead by, and the right one back


@dataclass(frozen=True, slots=True)
class Locked:
    """Cleaned frames."""

    translation: Float  # [A, F, 3] hips; lower while the feet are apart, and swaying more
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


def lock_feet(
    before: LockState,
    legs: Legs,
    translation: Float,
    rotations: Float,
    steps: Flags,
    waits: Flags,
    shortened: Float,
    upright: Array,
) -> Locked:
    """Clean the next F frames of A agents: translation [A, F, 3], rotations [A, F, 22, 4].

    `steps` [A]: those that are on the spot, whose feet step. `waits` [A]: of them those who stand,
    whose feet step late, see `PATIENT`. `shortened` [A]: the share that the
    way of the hips is shortened by at the last of these frames, see `strides.py`. `upright`
    [F, A]: how far they have straightened their knees, 0 … 1. Many frames at once or in pieces, the
    result is the same; every agent's is its own.
    """
    pose = pose_legs(legs, translation, rotations)
    facing = pose.facing
    along = (pose.ankle[:2] * facing).sum(0)  # [2, F, A]
    reach, evened = even_steps(before.reach.T, before.evened, along, steps)
    drawn = draw_in(along, facing, before.shortened, shortened, evened)
    if drawn is not None:
        pose.soles[:2] += drawn[:, None]
    path = np.concatenate([before.soles.T[:, :, :, None], pose.soles], -2)  # [3, P, 2, 1 + F, A]
    height = pose.soles[2].min(0)
    bearing, turning = _slide(path, height), _turning(path)
    slide = np.where(steps, np.diff(path[:2], axis=-2).mean(1), bearing)
    speed = FPS * length(bearing)
    touches = (height < TOUCH_HEIGHT) & (speed < TOUCH_SPEED)
    stays = (height < LIFT_HEIGHT) & (speed < LIFT_SPEED)
    firmness = 1 - smooth(speed, *SLIPPING)
    settling = -height * (1 - smooth(height, 0, DROP))

    contact, hold, shift = before.contact.T, before.hold.T, before.shift.T
    turn, swing, aim = before.turn.T, before.swing.T, before.aim.T
    shifts = np.empty((3, *height.shape), np.float32)
    turns = np.empty(height.shape, np.float32)
    held = np.empty(height.shape, np.bool_)
    landings, rests = plan_landings(slide, turning)
    turning = turning * steps
    apart = np.diff(pose.soles[:2].mean(1), axis=1)[:, 0]  # [2, F, A] from left to right foot
    between = length(apart)
    across = apart / np.maximum(between, 1e-6)
    bounds = np.where(rests, TIDY, np.where(waits, PATIENT, 1))
    for frame in range(height.shape[1]):
        contact = np.where(contact, stays[:, frame], touches[:, frame])
        hold = bounded(hold + np.where(contact, RISE, -RISE), 0, 1)
        swing = set_out(swing, contact & steps, shift, turn, bounds[frame], across[:, frame])
        flies = FLIES[swing]
        leashed = firmness[:, frame] * (1 - smooth(length(shift[:2]), *LEASH))
        grip = hold * np.where(steps, 1, leashed) * ~flies
        kept = np.where(flies, KEPT[swing], 1 - (1 - grip) * FADE)
        ahead = flies * (1 - kept)
        swing = np.maximum(swing - 1, 0)
        level = shift[2] + SETTLE * (hold * settling[:, frame] - shift[2])
        moved, twist = shifts[:, :, frame], turns[:, frame]
        landing = landings[:, :, frame] * steps
        landing[:2] = uncrossed(landing[:2], shift, between[frame], across[:, frame])
        aim = aim + AIM * (landing - aim)
        moved[:2] = kept * shift[:2] + ahead * aim[:2] - grip * slide[:, :, frame]
        moved[2] = level
        twist[:] = kept * turn + ahead * aim[2] - grip * turning[:, frame]
        shift, turn = moved.copy(), twist
        moved[2] += LIFT[swing]
        held[:, frame] = contact & (grip >= 0.5) & (height[:, frame] + moved[2] <= TOLD_HEIGHT)

    bears = 1 - smooth(height.min(0), *AIRBORNE)
    sunk = lower_hips(pose, legs, drawn, shifts, upright) * bears
    leg = (length(legs.knee.T) + length(legs.ankle.T))[:, None]  # [2, 1, A]
    spare = leg - length(pose.ankle - pose.hip)  # a knee that is nearly straight would snap
    kick = np.minimum(_kick(pose.ankle[2] + translation[..., 2].T, height), SPARED * spare)
    swayed = sway_hips(along, facing[:, 0], speed, reach) * bears
    shifts[2] += sunk - kick * bears
    shifts[:2] -= swayed[:, None]
    if drawn is not None:
        shifts[:2] += drawn
        pose.soles[:2] -= drawn[:, None]
    lowered, cleaned = translation.astype(np.float32), rotations.astype(np.float32)
    lowered[..., 2] -= sunk.T
    lowered[..., :2] += swayed.T
    free = FREE + (np.float32(STRAIGHTENED) - FREE) * upright
    cleaned[:, :, MOVED] = move_feet(pose, translation, shifts, turns, free)
    after = LockState(
        soles=path[:, :, :, -1].T,
        contact=contact.T,
        hold=hold.T,
        shift=shift.T,
        turn=turn.T,
        aim=aim.T,
        swing=swing.T,
        shortened=shortened,
        reach=reach[:, -1].T,
        evened=evened[-1],
    )
    return Locked(lowered, cleaned, held.T, after)


def _kick(ankle: Array, sole: Array) -> Array:
    """Metres by which feet [2, F, A] are lowered whose ankles and soles are so high."""
    low, high = KICKED
    over = bounded(ankle - low, 0, high - low)
    over = over * over / (2 * (high - low)) + np.maximum(ankle - high, 0)
    return KICK * over * smooth(sole, *CLEAR)


def _slide(path: Array, height: Array) -> Array:
    """Horizontal way of the bearing point since the last frame [2, 2, F, A].

    path [3, P, 2, 1 + F, A] of the sole points; height [2, F, A] of the lowest one.
    """
    load = np.exp((height - path[2, :, :, 1:]) / SOFTNESS)
    way: Array = (load * np.diff(path[:2], axis=-2)).sum(1) / load.sum(0)
    return way


def _turning(path: Array) -> Array:
    """Radians by which each foot turns about the vertical in each frame [2, F, A]."""
    x, y = path[:2, -1] - path[:2, 0]  # from the heel to the toe
    crossed = x[:, :-1] * y[:, 1:] - y[:, :-1] * x[:, 1:]
    turning: Array = np.arctan2(crossed, x[:, :-1] * x[:, 1:] + y[:, :-1] * y[:, 1:])
    return turning
