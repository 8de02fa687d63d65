"""Foot lock: feet that bear weight stay where they are.

The model's feet slide: by 5 to 7 cm/s while it walks, 11 to 16 to the side and back. Here the slide
of a bearing foot is taken off a step's new frames, one after the other, as a *shift* of its ankle
that two-bone inverse kinematics carries out; while the foot swings, the shift fades away:

    contact   low and slow, with hysteresis; hold follows it within 3 frames
    shift     − grip · slide of the bearing point       a gripped foot stands still
              − (1 − grip) · FADE · shift               a free one returns to the model's place
    turn      − firm · swivel of the foot               nor does a flat foot turn on the floor
              − (1 − firm) · FADE · turn
    height    while in contact the lowest sole point settles on the floor, z = 0

The point that bears is the lowest of the sole (a soft minimum over heel, balls and toe), so a foot
rolls over its ball, and pivots about it. Only motion is subtracted, and no place is set, so nothing
jumps when the bearing point changes, at contact, or at a seam. A shift beyond a *leash*, or a foot
that is pulled away or turned fast, gradually loosens the grip. A foot turns about the point that
bears, and freely once its heel is up.

The next step starts from the lock's result: the markers of a leg move with its knee and ankle. So
the feet of a gliding body hold it until it steps. The lock needs no memory: the two frames before a
seam show whether a foot bears there.

Pure functions; world space, metres, 40 frames per second.
"""

from collections.abc import Sequence
from math import atan2, cos, exp, sin, sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner
from wayfarer.spec import FPS
from wayfarer.world.output.legs import SOLES, Bones, Leg, Legs, bones, packed, pose_leg, sole_point
from wayfarer.world.output.turns import (
    Vector,
    add,
    less,
    multiply,
    put_vector,
    rotate,
    smooth,
    vector,
)
from wayfarer.world.output.twobone import Moved, move_ankle, put_leg
from wayfarer.world.rows import Double, Flags, Float

TOUCH_HEIGHT: Final = 0.03
"""Metres; a lower and slower foot comes into contact."""

TOUCH_SPEED: Final = 0.4
"""Metres per second, horizontal, of the bearing point, below which a foot comes into contact."""

LIFT_HEIGHT: Final = 0.05
"""Metres; a foot in contact that rises above this has left the floor."""

LIFT_SPEED: Final = 0.7
"""Metres per second; a foot in contact that is faster has left the floor."""

TOLD_HEIGHT: Final = 0.02
"""Metres; a foot whose lowest point is sent higher is not reported as in contact."""

RISE: Final = 1 / 3
"""Change of a hold per frame: it rises, and falls, over 3 frames."""

SLIPPING: Final = (0.25, LIFT_SPEED)
"""Metres per second between which a foot gradually breaks loose."""

SWIVELLING: Final = (2.0, 6.0)
"""Radians per second between which a turning foot gradually breaks loose."""

TILTED: Final = (0.01, 0.025)
"""Metres from heel to balls, up or down, between which a foot ceases to be flat."""

LEASH: Final = (0.09, 0.14)
"""Metres of horizontal shift between which the grip gradually releases: a foot that is pulled for
long slides along with the body instead of snapping back.
"""

FADE: Final = 1 / (0.15 * FPS)
"""Share of its shift that a free foot loses in a frame: three quarters of it in 0.2 s."""

SETTLE: Final = 0.25
"""Share of a height error that is removed per frame. With 1, straight knees would shake."""

DROP: Final = 0.02
"""Height in metres from which a foot in contact is not pulled down; below, it is pulled less the
higher it is.
"""

SOFTNESS: Final = 0.006
"""Metres above the lowest sole point at which a point bears 1/e of that point's load."""

MIN_LOAD: Final = -40
"""Exponent of the smallest load that counts; a smaller one is lost in rounding."""


_SHARES: Final = {
    "THI": (0.5, 0.0),
    "KNE": (1.0, 0.0),
    "KNI": (1.0, 0.0),
    "SHN": (0.5, 0.5),
    "CLF": (0.5, 0.5),
    **dict.fromkeys(("ANK", "HEE", "TOE", "MT1", "MT5"), (0.0, 1.0)),
    **dict.fromkeys(("SOLE_HEEL", "SOLE_MT1", "SOLE_MT5", "SOLE_TOE"), (0.0, 1.0)),
}
"""Shares of the knee's and ankle's shift that a marker of the leg follows. Names lack the side."""


class Planted(NamedTuple):
    """The parts of a step's new frames that the lock changes."""

    rotations: Float  # [A, F, 22, 4] hips, knees and ankles of both legs
    markers: Float  # [A, S, M, 3] of the last S frames
    contacts: Flags  # [A, F, 2] feet that are held and on the floor


def leg_shares(markers: Sequence[str]) -> Float:
    """Shares of markers [M, 2, 2] in the shifts of the left and right leg's knee and ankle."""
    shares = np.zeros((len(markers), 2, 2), np.float32)
    for number, name in enumerate(markers):
        if name[0] in "LR":
            shares[number, "LR".index(name[0])] = _SHARES.get(name[1:], (0.0, 0.0))
    return shares


def lock_feet(
    wanted: Flags,
    legs: Legs,
    shares: Float,
    seed: tuple[Float, Float],
    translation: Float,
    step: Planted,
) -> Planted:
    """The next F frames of A agents, with feet locked for agents in `wanted` [A].

    translation [A, F, 3]. `seed` has translation [A, 2, 3] and rotations [A, 2, 22, 4] of the two
    frames before; `shares` are the markers' (`leg_shares`). Agents do not influence each other.
    """
    made = Planted(
        np.array(step.rotations, np.float32, order="C"),
        np.array(step.markers, np.float32, order="C"),
        np.array(step.contacts, np.bool_, order="C"),
    )
    hips, turns = packed(seed[0]), packed(seed[1])
    lock_rows(wanted, bones(legs), shares, hips, turns, packed(translation), made)
    return made


@compiled
def lock_rows(
    wanted: Flags,
    legs: Bones,
    shares: Float,
    seed_hips: Float,
    seed_turns: Float,
    translation: Float,
    step: Planted,
) -> None:
    """Changes `step` in place."""
    rotations, markers, held = step
    was, now = np.empty((SOLES, 3)), np.empty((SOLES, 3))
    frames, last = rotations.shape[1], seed_turns.shape[1] - 1
    for row in range(len(rotations)):
        for foot in range(2 if wanted[row] else 0):
            _put_soles(legs, row, last - 1, foot, seed_hips, seed_turns, was)
            _put_soles(legs, row, last, foot, seed_hips, seed_turns, now)
            slide_x, slide_y, height, _, _ = _slide(was, now)
            contact = height < TOUCH_HEIGHT and _speed(slide_x, slide_y) < TOUCH_SPEED
            hold, x, y, z, yaw = (1.0 if contact else 0.0), 0.0, 0.0, 0.0, 0.0
            for frame in range(frames):
                was, now = now, was
                leg = _put_soles(legs, row, frame, foot, translation, rotations, now)
                slide_x, slide_y, height, bears_x, bears_y = _slide(was, now)
                speed = _speed(slide_x, slide_y)
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
                swivel, tilt = _swivel(was, now)
                turning = FPS * abs(swivel)
                firm = 1 - smooth(turning, SWIVELLING[0], SWIVELLING[1])
                firm *= hold * (1 - smooth(tilt, TILTED[0], TILTED[1]))
                yaw = (1 - (1 - firm) * FADE) * yaw - firm * swivel
                z += SETTLE * (hold * settling - z)
                held[row, frame, foot] = contact and grip >= 0.5 and height + z <= TOLD_HEIGHT
                thigh, shin = less(leg.knee, leg.hip), less(leg.ankle, leg.knee)
                root = vector(translation, (row, frame))
                ankle_x, ankle_y = root[0] + leg.ankle[0], root[1] + leg.ankle[1]
                off_x, off_y = _turned_off(yaw, ankle_x - bears_x, ankle_y - bears_y)
                made = move_ankle(
                    leg.root_turn,
                    leg.hip_turn,
                    leg.knee_turn,
                    multiply((0.0, 0.0, sin(yaw / 2), cos(yaw / 2)), leg.ankle_turn),
                    thigh,
                    shin,
                    (x + off_x, y + off_y, z),
                )
                put_leg(rotations, row, frame, foot, made)
                seed = frame - (frames - markers.shape[1])
                if seed >= 0:
                    ankle = ankle_x, ankle_y
                    _follow(legs, shares, row, seed, foot, leg, made, yaw, ankle, markers)


@inner
def _put_soles(
    legs: Bones,
    row: int,
    frame: int,
    foot: int,
    translation: Float,
    rotations: Float,
    soles: Double,
) -> Leg:
    """The leg in a frame; writes its sole points [P, 3] into `soles`."""
    leg = pose_leg(legs, row, frame, foot, rotations)
    root = vector(translation, (row, frame))
    for point in range(SOLES):
        put_vector(soles, (point,), sole_point(legs, row, foot, point, leg, root))
    return leg


@inner
def _follow(
    legs: Bones,
    shares: Float,
    row: int,
    frame: int,
    foot: int,
    leg: Leg,
    made: Moved,
    yaw: float,
    ankle_was: tuple[float, float],
    markers: Float,
) -> None:
    """Moves markers [A, S, M, 3] along with a moved leg and its turned foot."""
    hip_turn = multiply(leg.root_turn, made.hip)
    knee = rotate(hip_turn, vector(legs.knee, (row, foot)))
    knee_turn = multiply(hip_turn, made.knee)
    ankle = add(knee, rotate(knee_turn, vector(legs.ankle, (row, foot))))
    of_knee: Vector = less(knee, less(leg.knee, leg.hip))
    of_ankle: Vector = less(ankle, less(leg.ankle, leg.hip))
    for marker in range(len(shares)):
        by_knee, by_ankle = shares[marker, foot, 0], shares[marker, foot, 1]
        if by_ankle == 1:
            arm_x = markers[row, frame, marker, 0] - ankle_was[0]
            off_x, off_y = _turned_off(yaw, arm_x, markers[row, frame, marker, 1] - ankle_was[1])
            markers[row, frame, marker, 0] += off_x
            markers[row, frame, marker, 1] += off_y
        if by_knee > 0 or by_ankle > 0:
            for axis in range(3):
                way = by_knee * of_knee[axis] + by_ankle * of_ankle[axis]
                markers[row, frame, marker, axis] += way


@inner
def _swivel(was: Double, now: Double) -> tuple[float, float]:
    """Radians that a foot has turned since the last frame, from sole points [P, 3] from heel to
    toe, and the height of its heel above its balls in metres.
    """
    before_x, before_y = _along(was)
    x, y = _along(now)
    tilt = abs(now[0, 2] - (now[1, 2] + now[2, 2]) / 2)
    return atan2(before_x * y - before_y * x, before_x * x + before_y * y), tilt


@inner
def _along(soles: Double) -> tuple[float, float]:
    """Horizontally from the heel to between the balls of a foot."""
    return (
        (soles[1, 0] + soles[2, 0]) / 2 - soles[0, 0],
        (soles[1, 1] + soles[2, 1]) / 2 - soles[0, 1],
    )


@inner
def _turned_off(yaw: float, x: float, y: float) -> tuple[float, float]:
    """Displacement of the end of an arm that turns by `yaw`."""
    sine, less_cosine = sin(yaw), cos(yaw) - 1
    return less_cosine * x - sine * y, sine * x + less_cosine * y


@inner
def _speed(slide_x: float, slide_y: float) -> float:
    return FPS * sqrt(slide_x * slide_x + slide_y * slide_y)


@inner
def _slide(was: Double, now: Double) -> tuple[float, float, float, float, float]:
    """Horizontal way of the bearing point since the last frame, from sole points [P, 3], its
    height, which is the lowest point's, and its place.
    """
    height, total, x, y, at_x, at_y = now[0, 2], 0.0, 0.0, 0.0, 0.0, 0.0
    for point in range(1, SOLES):
        height = min(height, now[point, 2])
    for point in range(SOLES):
        over = (height - now[point, 2]) / SOFTNESS
        if over > MIN_LOAD:
            load = exp(over)
            total += load
            x += load * (now[point, 0] - was[point, 0])
            y += load * (now[point, 1] - was[point, 1])
            at_x += load * now[point, 0]
            at_y += load * now[point, 1]
    return x / total, y / total, height, at_x / total, at_y / total
