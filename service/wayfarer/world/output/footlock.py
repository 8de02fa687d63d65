"""Foot lock: feet that bear weight stay where they are.

The model's feet slide by a few cm/s. Here the slide of a bearing foot is taken off frame by frame,
as a *shift* of its ankle that two-bone inverse kinematics carries out; while the foot swings, the
shift fades away:

    contact   low and slow, with hysteresis; hold follows it within 3 frames
    shift     − grip · slide of the bearing point       a gripped foot stands still
              − (1 − grip) · FADE · shift               a free one returns to the model's place
    height    while in contact the lowest sole point settles on the floor, z = 0
    limp      left and right steps become as long: of who walks one foot is moved ahead, the other
              one back

An agent that stands or turns on the spot *steps*: the lock keeps the turn of its feet, too, and a
foot that has come too far from where the model has it is lifted and set down there a moment later,
one foot after the other. So a body that turns, or is moved, takes its feet along as people do.

The hips rise and fall a little more than the model's do, see `LOWERED`, while a foot bears. They
sway more over the foot that bears, too, and go faster from one foot to the other, see `SWAY`.

The point that bears is the lowest of the sole (a soft minimum over heel, balls and toe), so a foot
rolls over its ball. Only motion is taken off, never a place set, so nothing jumps when the bearing
point changes, at contact, or at a seam, over which the state carries the shift. A shift that grows
beyond a *leash*, or a foot that is pulled away fast, loosens the grip by degrees. Feet keep their
turn in the world.

This cleans what is sent and nothing else: the seeds of the next primitive stay the model's own, so
the lock cannot disturb the model. Pure functions; world space, metres, 40 frames per second.
"""

from dataclasses import dataclass
from math import radians
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS
from wayfarer.world.output.legs import SOLES, LegPose, Legs, pose_legs
from wayfarer.world.output.quaternion import Array, bounded, length
from wayfarer.world.output.twobone import FREE, MOVED, move_ankles, move_feet
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

RAISED: Final = 0.006
LOWERED: Final = 0.013
"""Metres by which hips are raised over feet that are `CLOSE` to each other, as far as knees are
bent, and lowered over those that are `WIDE` apart: people come down with each step."""

STRAIGHTENED: Final = 0.85
"""Share of what bent knees take off the shorter leg by which the hips of who stands upright are
raised instead; legs reach that far without being eased, see `twobone.FREE`."""

SWAY: Final = 0.016
SURGE: Final = 0.009
"""Metres by which hips are moved aside, over the foot that bears, and along their way: the model's
hips glide, as if on wheels. For steps of `AMPLE` and more; for smaller ones in proportion."""

AMPLE: Final = 0.5
"""Metres from ankle to ankle, along the facing, …"""

LONG: Final = (0.66, 0.80)
"""… between which steps are so long that the model's hips surge by themselves, more and more."""

STILL: Final = 0.6
"""Metres per second: what both feet together are slower than is no step."""

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

EVEN: Final = 1 / (1.3 * FPS)
"""Share by which feet are moved in a frame towards where left and right steps are as long …"""

EVEN_MOST: Final = 0.05
"""… and metres at most: the model's walkers limp, people hardly do."""

FORGET: Final = 0.025 / FPS
"""Metres by which the longest step that is remembered of either foot shrinks in a frame."""

CLOSE: Final = 0.2
WIDE: Final = 0.75
"""Metres from ankle to ankle."""

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
    reach, evened = _evened(before, along, steps)
    drawn = _drawn_in(along, facing, before.shortened, shortened, evened)
    if drawn is not None:
        pose.soles[:2] += drawn[:, None]
    path = np.concatenate([before.soles.T[:, :, :, None], pose.soles], -2)  # [3, P, 2, 1 + F, A]
    height = pose.soles[2].min(0)
    bearing, turning = _slide(path, height), _turning(path)
    slide = np.where(steps, np.diff(path[:2], axis=-2).mean(1), bearing)
    speed = FPS * length(bearing)
    touches = (height < TOUCH_HEIGHT) & (speed < TOUCH_SPEED)
    stays = (height < LIFT_HEIGHT) & (speed < LIFT_SPEED)
    firmness = 1 - _smooth(speed, *SLIPPING)
    settling = -height * (1 - _smooth(height, 0, DROP))

    contact, hold, shift = before.contact.T, before.hold.T, before.shift.T
    turn, swing, aim = before.turn.T, before.swing.T, before.aim.T
    shifts = np.empty((3, *height.shape), np.float32)
    turns = np.empty(height.shape, np.float32)
    held = np.empty(height.shape, np.bool_)
    landings, rests = _landings(slide, turning)
    turning = turning * steps
    apart = np.diff(pose.soles[:2].mean(1), axis=1)[:, 0]  # [2, F, A] from left to right foot
    between = length(apart)
    across = apart / np.maximum(between, 1e-6)
    bounds = np.where(rests, TIDY, np.where(waits, PATIENT, 1))
    for frame in range(height.shape[1]):
        contact = np.where(contact, stays[:, frame], touches[:, frame])
        hold = bounded(hold + np.where(contact, RISE, -RISE), 0, 1)
        swing = _begun(swing, contact & steps, shift, turn, bounds[frame], across[:, frame])
        flies = _FLIES[swing]
        leashed = firmness[:, frame] * (1 - _smooth(length(shift[:2]), *LEASH))
        grip = hold * np.where(steps, 1, leashed) * ~flies
        kept = np.where(flies, _KEPT[swing], 1 - (1 - grip) * FADE)
        ahead = flies * (1 - kept)
        swing = np.maximum(swing - 1, 0)
        level = shift[2] + SETTLE * (hold * settling[:, frame] - shift[2])
        moved, twist = shifts[:, :, frame], turns[:, frame]
        landing = landings[:, :, frame] * steps
        landing[:2] = _uncrossed(landing[:2], shift, between[frame], across[:, frame])
        aim = aim + AIM * (landing - aim)
        moved[:2] = kept * shift[:2] + ahead * aim[:2] - grip * slide[:, :, frame]
        moved[2] = level
        twist[:] = kept * turn + ahead * aim[2] - grip * turning[:, frame]
        shift, turn = moved.copy(), twist
        moved[2] += _LIFT[swing]
        held[:, frame] = contact & (grip >= 0.5) & (height[:, frame] + moved[2] <= TOLD_HEIGHT)

    bears = 1 - _smooth(height.min(0), *AIRBORNE)
    sunk = _sunk(pose, legs, drawn, shifts, upright) * bears
    leg = (length(legs.knee.T) + length(legs.ankle.T))[:, None]  # [2, 1, A]
    spare = leg - length(pose.ankle - pose.hip)  # a knee that is nearly straight would snap
    kick = np.minimum(_kick(pose.ankle[2] + translation[..., 2].T, height), SPARED * spare)
    swayed = _swayed(along, facing[:, 0], speed, reach) * bears
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


def shorten_steps(
    legs: Legs, translation: Float, rotations: Float, before: Float, after: Float
) -> Float:
    """Rotations [A, F, 22, 4] of frames whose feet are not locked, with steps as long as the way of
    the hips: that has been shortened by these shares [A] before the first and at the last of them.
    """
    pose = pose_legs(legs, translation, rotations)
    along = (pose.ankle[:2] * pose.facing).sum(0)
    shift = np.zeros(pose.ankle.shape, np.float32)
    if (drawn := _drawn_in(along, pose.facing, before, after, np.zeros_like(along[0]))) is not None:
        shift[:2] = drawn
    found = rotations.astype(np.float32)
    found[:, :, MOVED] = move_ankles(pose, shift)
    return found


def _evened(before: LockState, along: Array, steps: Flags) -> tuple[Array, Array]:
    """How far each foot gets ahead of the other [2, F, A], and metres [F, A] that the left one is
    moved ahead by, and the right one back, so that it is as far: of ankles `along` [2, F, A] the
    facing.
    """
    lead = along[0] - along[1]
    reach = before.reach.T
    moved: Array = before.evened
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


def _drawn_in(
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


_SIDES: Final = np.array([1.0, -1.0], np.float32)[:, None, None]
"""Left and right foot."""


def _sunk(pose: LegPose, legs: Legs, drawn: Array | None, shifts: Array, upright: Array) -> Array:
    """Metres by which hips are lowered over their feet [F, A], which are moved by `shifts`
    [3, 2, F, A]; over those of who stands upright [F, A] they are raised.
    """
    ankle = pose.ankle[:2] if drawn is None else pose.ankle[:2] + drawn
    apart = ankle[:, 0] - ankle[:, 1]
    square = bounded((apart * apart).sum(0), CLOSE**2, WIDE**2)
    wide = (square - CLOSE**2) / (WIDE**2 - CLOSE**2)
    leg = (length(legs.knee.T) + length(legs.ankle.T))[:, None]  # [2, 1, A]
    spare = (leg - length(pose.ankle - pose.hip)).min(0)  # straight knees lift nobody
    walking = LOWERED * wide - np.minimum(RAISED, spare / 2) * (1 - wide)
    placed = pose.ankle - pose.hip
    placed[:2] += shifts[:2] if drawn is None else shifts[:2] + drawn
    straight = -STRAIGHTENED * np.maximum((leg - length(placed)).min(0), 0)
    found: Array = walking + upright * (straight - walking)
    return found


def _swayed(along: Array, facing: Array, speed: Array, reach: Array) -> Array:
    """Metres [2, F, A] by which hips are moved that face `facing` [2, F, A], with ankles `along`
    [2, F, A] that way, sole speeds [2, F, A] and feet that get ahead of each other by `reach`
    [2, F, A].

    A half of a sine in each step aside, to the foot that bears, and a whole one along. Both are
    zero when the feet are farthest apart and the weight goes from one foot to the other.
    """
    stride = reach.mean(0)
    phase = bounded((along[0] - along[1]) / np.maximum(stride, 0.1), -1, 1)
    on_left = (speed[1] - speed[0]) / np.maximum(speed[0] + speed[1], STILL)  # 1: on the left foot
    strong = on_left * np.minimum(stride / AMPLE, 1)
    aside = -SWAY * strong * np.cos(np.pi / 2 * phase)  # to the right
    ahead = SURGE * strong * (1 - _smooth(stride, *LONG)) * np.sin(np.pi * phase)
    x, y = facing
    return np.stack([ahead * x + aside * y, ahead * y - aside * x]).astype(np.float32)


def _kick(ankle: Array, sole: Array) -> Array:
    """Metres by which feet [2, F, A] are lowered whose ankles and soles are so high."""
    low, high = KICKED
    over = bounded(ankle - low, 0, high - low)
    over = over * over / (2 * (high - low)) + np.maximum(ankle - high, 0)
    return KICK * over * _smooth(sole, *CLEAR)


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


def _landings(slide: Array, turning: Array) -> tuple[Array, Flags]:
    """Where a foot that steps now is to land, ahead of the model: shift (x, y) and turn
    [3, 2, F, A]; and whether the model's feet rest [F, A].
    """
    way, speed = STEP_AHEAD * FPS * slide, FPS * length(slide)
    shift = way * np.minimum(1, AHEAD_SHIFT / np.maximum(STEP_AHEAD * speed, 1e-9))
    turn = bounded(STEP_AHEAD * FPS * turning, -AHEAD_TURN, AHEAD_TURN)
    slow, quiet = RESTING
    rests: Flags = np.all((speed < slow) & (FPS * np.abs(turning) < quiet), axis=0)
    return np.concatenate([shift, turn[None]]), rests


def _begun(
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


def _uncrossed(goals: Array, shift: Array, between: Array, across: Array) -> Array:
    """Landings [2, 2, A] at which a foot does not come nearer to the other one than `APART`.

    The model has the feet `between` [A] metres apart in the direction `across` [2, A].
    """
    left = APART - between - ((shift[:2, 1] - goals[:, 0]) * across).sum(0)
    right = APART - between - ((goals[:, 1] - shift[:2, 0]) * across).sum(0)
    moved = goals.copy()
    moved[:, 0] -= np.maximum(left, 0) * across
    moved[:, 1] += np.maximum(right, 0) * across
    return moved


def _smooth(value: Array, low: float, high: float) -> Array:
    """0 below `low`, 1 above `high`, smooth between."""
    t = bounded((value - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _step_tables() -> tuple[Flags, Array, Array]:
    """From the remaining frames of a step: whether the foot flies in the next frame, the share of
    its shift and turn that stays then, and the metres that it is raised by.

    It moves and turns in the air: not while it is lifted, nor while it is set down.
    """
    frames = np.arange(STEP_FRAMES + 1)
    left = _smooth(frames / STEP_FRAMES, *FLIGHT)
    later = np.concatenate([[0.0], left[:-1]])
    flies = (left > 0) & (later < 1)
    kept = np.where(flies, later / np.maximum(left, 1e-6), 1.0)
    lift = STEP_HEIGHT * np.sin(np.pi * frames / STEP_FRAMES) ** 2
    return flies, kept.astype(np.float32), lift.astype(np.float32)


_FLIES, _KEPT, _LIFT = _step_tables()
