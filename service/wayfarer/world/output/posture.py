"""Posture: how trunk, head and arms are held in what is sent.

The model bends its walkers forward, and their eyes are on the floor; and all of them hold their
arms alike. Frame by frame:

    trunk   a part of what it leans forward beyond `UPRIGHT` is removed, up to `TRUNK_MOST`
    head    is levelled: most of its pitch away from `LEVEL` is taken off, as people keep their
            eyes on what is ahead of them, half in the neck and half in the head
    arms    swing wider or less, hang farther from the body or with elbows more bent, and are
            turned more or less about themselves, as are hands: each agent's have habits of their
            own, see `habits`. So have trunk and head.
    rest    who stands lets the arms hang, see `HANGING` and `RELAXED`: the model leaves them where
            the walk has, bent and often one of them ahead, for as long as somebody stands

Lean and pitch are those of the last steps: how trunk and head swing within a step is left as it is.
They are remembered, and so is how far somebody has come to rest.

Legs and hips are untouched, and so is the motion that the next primitive starts from. Arrays have
their components first, see `quaternion.py`; angles are radians about axes of the joint above: X to
the right, Y ahead, Z up.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from typing import Final, NamedTuple

import numpy as np

from wayfarer.body.skeleton import joint_names
from wayfarer.spec import FPS
from wayfarer.world.output.quaternion import Array, bounded, multiply, stacked, unit
from wayfarer.world.rows import Flags, Float, Rows

UPRIGHT: Final = (radians(-1.5), radians(1.5))
"""Range over agents of the forward lean of the trunk that is left as it is."""

TRUNK_SHARE: Final = 0.85
"""Share of the lean beyond it that is removed."""

TRUNK_MOST: Final = radians(5)
"""Largest lean that is removed."""

LEVEL: Final = (radians(-13), radians(-3))
"""Range over agents of the pitch of a head that looks ahead: people's is a little below the
horizon."""

HEAD_SHARE: Final = 0.6
"""Share of the head's pitch away from that which is removed."""

HEAD_MOST: Final = radians(15)
"""Largest pitch that is removed."""

FOLLOW: Final = 1 / (0.4 * FPS)
"""Share by which the remembered lean and pitch follow in a frame: a step takes half a second, and
little of what comes and goes with it is seen in them."""

SWING: Final = (0.5, 1.8)
"""Factors of the arms' swing about the vertical, from the one that holds them still to the one that
lets them go: people's swing differs by as much (standard deviation 15° at 1.1 to 1.5 m/s)."""

SWING_MOST: Final = radians(20)
"""An arm is not moved by more: one that points or is lifted is no swinging arm."""

ASIDE: Final = (radians(-1), radians(10))
"""Range over agents of the angle by which arms hang farther from the body."""

ELBOWS: Final = (radians(0), radians(22))
"""Range over agents of the elbows' bend."""

UNEVEN: Final = radians(5)
"""Largest difference between left and right, either way."""


TURNED: Final = (radians(-3), radians(16))
"""Range over agents of the angle by which upper arms are turned about themselves, outwards: inwards
bent arms would reach into the body."""

HANDS: Final = (radians(20), radians(14))
"""Largest angles by which hands are turned about the forearm, and to the palm or away from it."""

CALMING: Final = 1 / (1.2 * FPS)
LEAVING: Final = 1 / (0.6 * FPS)
"""Share of the way that somebody comes to rest in a frame, and goes from it."""

HANGING: Final = radians(-4)
"""Angle by which upper arms that hang at rest point ahead of straight down."""

HANGING_MOST: Final = radians(45)
"""An arm is not moved by more for it."""

HANGING_ASIDE: Final = radians(3)
"""Angle by which they hang farther from the body, beside their owner's habit: a straight arm is
nearer to the thigh."""

RELAXED: Final = (radians(6), radians(-4))
"""Angles by which an elbow at rest is bent, beside its owner's habit, and which its forearm has
about the axis that lies across: the model's bend has this direction, and is 35° in those who stand.
"""

PALM: Final = (radians(-2), radians(-14), radians(-7))
"""And those of its wrist."""

DRAWN: Final = 12
"""Numbers that the habits of an agent follow from."""


def _numbers(*names: str) -> list[int]:
    return [joint_names().index(name) for name in names]


TRUNK: Final = _numbers("pelvis", "spine1", "spine2", "spine3", "neck", "head")
SHOULDERS: Final = _numbers("left_shoulder", "right_shoulder")
ELBOW_JOINTS: Final = _numbers("left_elbow", "right_elbow")
WRISTS: Final = _numbers("left_wrist", "right_wrist")
SPINE, NECK, HEAD = (TRUNK[k] for k in (1, 4, 5))

_SIDES: Final = np.array([-1.0, 1.0], np.float32)[:, None, None]
"""Arms of the T-pose point along X: the left one to its negative."""


@dataclass(slots=True)
class PostureState(Rows):
    """How trunk and head have been for the last steps, as the model has them, radians; and rest."""

    lean: Float  # that the chest looks up
    pitch: Float  # that the head does
    rest: Float  # 0…1: how far they have come to rest, since 2026-11-23
    upright: Float  # and have straightened their knees


class Habits(NamedTuple):
    """How A agents hold themselves, left arm before right; radians."""

    swing: Array  # [A] factor
    aside: Array  # [2, A]
    elbows: Array  # [2, A]
    turned: Array  # [A] upper arms, outwards
    hands: Array  # [2, A] about the forearm, and towards the palm
    lean: Array  # [A] forward lean of the trunk that is left
    level: Array  # [A] pitch of the head


def habits(numbers: Sequence[Array]) -> Habits:
    """Those of agents [A] from `DRAWN` numbers of each, 0 … 1."""
    swing, aside, elbows, turned, about, bent, lean, level, *uneven = numbers

    def between(low: float, high: float, share: Array) -> Array:
        return low + (high - low) * share

    more = (2 * np.stack(uneven) - 1) * UNEVEN
    return Habits(
        between(*SWING, swing),
        between(*ASIDE, aside) + more[:2] / 2,
        np.maximum(between(*ELBOWS, elbows) + more[2:], 0),  # never beyond straight
        between(*TURNED, turned),
        np.stack([between(-HANDS[0], HANDS[0], about), between(-HANDS[1], HANDS[1], bent)]),
        between(*UPRIGHT, lean),
        between(*LEVEL, level),
    )


def settled(rotations: Float, rest: Flags, upright: Flags) -> PostureState:
    """The state of agents who have been in a pose for long: rotations [A, 22, 4], some of them at
    rest and upright [A].
    """
    chest, head = _looks(_local(rotations[:, None], TRUNK))
    return PostureState(chest[0], head[0], rest.astype(np.float32), upright.astype(np.float32))


def calmed(before: Float, rests: Flags, frames: int) -> tuple[Array, Float]:
    """How far those who rest now [A], and the others, are at rest in so many frames [F, A], eased;
    and at the end of them, `before` that at their start [A].
    """
    shares = np.empty((frames, len(before)), np.float32)
    share: Array = before
    for frame in range(frames):
        share = bounded(share + np.where(rests, np.float32(CALMING), np.float32(-LEAVING)), 0, 1)
        shares[frame] = share
    return shares * shares * (3 - 2 * shares), share


def hold(
    before: PostureState, rotations: Float, own: Habits, rest: Array
) -> tuple[Float, PostureState]:
    """Rotations [A, F, 22, 4] of frames as the model makes them, as they are sent, with agents so
    far at rest [F, A]. Many frames at once or in pieces, the result is the same.
    """
    local = _local(rotations, [*TRUNK, *SHOULDERS, *ELBOW_JOINTS, *WRISTS])
    lean, pitch = (
        _followed(*known)
        for known in zip((before.lean, before.pitch), _looks(local[:, :6]), strict=True)
    )
    back = bounded(TRUNK_SHARE * (-lean - own.lean), 0, TRUNK_MOST)
    up = bounded(HEAD_SHARE * (own.level - (pitch + back)), -HEAD_MOST, HEAD_MOST)
    held = rotations.copy()
    for joint, turned in (
        (SPINE, _about_x(back, local[:, 1])),
        (NECK, _about_x(up / 2, local[:, 4])),
        (HEAD, _about_x(up / 2, local[:, 5])),
    ):
        held[:, :, joint] = turned.transpose(2, 1, 0)
    down = HANGING - (lean + back)
    arms = _arms(local[:, 6:8], local[:, 8:10], local[:, 10:12], own, down, rest)
    for joints, turned in zip((SHOULDERS, ELBOW_JOINTS, WRISTS), arms, strict=True):
        held[:, :, joints] = turned.transpose(3, 2, 1, 0)
    return held, PostureState(lean[-1], pitch[-1], before.rest, before.upright)


def _local(rotations: Float, joints: Sequence[int]) -> Array:
    """Those of some joints, components first [4, J, F, A]."""
    return np.ascontiguousarray(rotations.take(joints, axis=2).transpose(3, 2, 1, 0))


def _looks(trunk: Array) -> tuple[Array, Array]:
    """Radians [F, A] that chest and head look up, of rotations [4, 6, F, A] from hips to head."""
    chest = trunk[:, 0]
    for k in range(1, 4):
        chest = multiply(chest, trunk[:, k])
    return _pitch(chest), _pitch(multiply(multiply(chest, trunk[:, 4]), trunk[:, 5]))


def _followed(value: Array, values: Array) -> Array:
    """What follows `values` [F, A] by degrees, from `value` [A] on."""
    found = np.empty_like(values)
    for frame, now in enumerate(values):
        value = value + np.float32(FOLLOW) * (now - value)
        found[frame] = value
    return found


def _arms(
    shoulders: Array, elbows: Array, wrists: Array, own: Habits, vertical: Array, rest: Array
) -> tuple[Array, Array, Array]:
    """Local rotations [4, 2, F, A] of shoulders, elbows and wrists, held as agents do.

    An arm at rest points `vertical` [F, A] radians ahead of where the chest's feet are; `rest` is
    how far each has come there [F, A].
    """
    x, y, z, w = shoulders
    # where the upper arm points, seen from the chest
    ahead, down = _SIDES * 2 * (x * y + w * z), -_SIDES * 2 * (x * z - w * y)
    hangs = bounded(2 * down - 0.4, 0, 1)  # not while it is lifted
    swung = np.arctan2(ahead, np.maximum(down, 0.2))
    off = vertical - swung
    more = bounded((1 - own.swing) * off, -SWING_MOST, SWING_MOST)
    hung = bounded(off, -HANGING_MOST, HANGING_MOST)
    more = (more + rest * (hung - more)) * hangs
    aside = (own.aside[:, None] + HANGING_ASIDE * rest) * hangs
    # an arm that hangs is moved away from the body about Y, to its own side
    half = 0.5 * more, -0.5 * _SIDES * aside, -0.5 * _SIDES * own.turned * hangs
    zero, one = np.zeros_like(half[0]), np.ones_like(half[0])
    moved = multiply(stacked(*half, one), shoulders)
    bend = 0.5 * _SIDES * own.elbows[:, None] * one
    elbows = _relaxed(elbows, _ELBOW, rest)
    bent = multiply(stacked(zero, zero, bend, one), elbows)
    wrists = _relaxed(wrists, _WRIST, rest)
    about, palm = 0.5 * own.hands[0] * one, 0.5 * _SIDES * own.hands[1] * one
    held = multiply(stacked(about, palm, zero, one), wrists)
    return unit(moved), unit(bent), unit(held)


def _relaxed(turns: Array, resting: Array, rest: Array) -> Array:
    """Local rotations [4, 2, F, A], so far [F, A] on their way to `resting` [4, 2, 1, 1]; not of
    unit length.
    """
    near = np.where(turns[3] < 0, np.float32(-1), np.float32(1))  # q and −q are one rotation
    found: Array = turns + rest * (near * resting - turns)
    return found


def _both(x: float, y: float, z: float) -> Array:
    """Small turns of the left and the right arm's joint [4, 2, 1, 1], as quaternions."""
    one = np.ones((2, 1, 1), np.float32)
    turns = stacked(0.5 * x * one, 0.5 * y * _SIDES, 0.5 * z * _SIDES, one)
    return unit(turns).astype(np.float32)


_ELBOW: Final = _both(0, RELAXED[1], RELAXED[0])
_WRIST: Final = _both(*PALM)


def _pitch(turn: Array) -> Array:
    """Radians that what points ahead in rotations [4, ...] looks up."""
    x, y, z, w = turn
    return np.arcsin(bounded(2 * (y * z + x * w), -1, 1))


def _about_x(angle: Array, turn: Array) -> Array:
    """Rotations [4, ...] turned, after themselves, about X by radians [...]."""
    x, y, z, w = turn
    sin, cos = np.sin(angle / 2), np.cos(angle / 2)
    return stacked(cos * x + sin * w, cos * y - sin * z, cos * z + sin * y, cos * w - sin * x)
