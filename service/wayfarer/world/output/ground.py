"""Uneven ground: what is sent stands on the floor of its scene; motion itself knows a flat one.

    feet    raised so that their soles keep the distance to the floor that they have to z = 0, and
            turned with its slope; a swinging foot looks ahead to where it is about to be, so it is
            up before it comes over a step
    hips    raised smoothly, a little less than the feet where these are at different heights

and two-bone inverse kinematics bends the legs between them. Everything follows its target by
degrees, frame by frame, over the seams of chunks, too. As the foot lock it cleans what is sent and
nothing else. World space, metres, 40 frames per second.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer.world.output.legs import LegPose, Legs, pose_legs
from wayfarer.world.output.quaternion import Array, multiply, rotate_points, stacked, unit
from wayfarer.world.output.twobone import MOVED, move_ankles
from wayfarer.world.rows import Flags, Float, Rows, Shape

Floor = Callable[[Array], Array]
"""Height of the floor at points [A, N, 2] of A agents. [A, N]"""

AHEAD: Final = 0.12
"""Seconds that a foot looks ahead."""

TILT_SHARE: Final = 1 - np.exp(-1 / (0.06 * FPS))
"""Share of the remaining slope that a foot turns to in a frame."""

STIFFNESS: Final = 12.0 / FPS
"""Stiffness per frame of the critically damped spring that lifts the hips."""

FOOT_STIFFNESS: Final = 34.0 / FPS
"""Stiffness per frame of the spring that lifts a foot."""

CROUCH: Final = 0.2
"""Share of the height between the feet by which the hips stay below the feet's mean."""

SPAN: Final = 0.06
"""Metres to either side of an ankle between which the slope is taken."""

STEEP: Final = 1.0
"""Rise over run: what is steeper is the edge of a step, and no slope."""


@dataclass(slots=True, eq=False)
class Footing(Rows):
    """How an agent was shown last."""

    hips: Float  # metres that the hips are raised
    rise: Float  # metres a frame by which they have just been raised more
    feet: Annotated[Float, Shape(2)]  # and the feet, left and right
    lift: Annotated[Float, Shape(2)]  # metres a frame by which these have just been raised more
    slope: Annotated[Float, Shape(2, 2)]  # rise over run along x and y that each foot is turned to
    ankles: Annotated[Float, Shape(2, 2)]  # metres: where they were
    begun: Flags  # `ankles` means something


@dataclass(frozen=True, slots=True)
class Grounded:
    """Frames on the ground."""

    translation: Float  # [A, F, 3]
    rotations: Float  # [A, F, 22, 4]
    footing: Footing


def standing(floors: Sequence[float]) -> Footing:
    """The footing of agents that stand on floors of these heights."""
    footing = Footing.empty(len(floors))
    footing.hips[:] = floors
    footing.feet[:] = footing.hips[:, None]
    return footing


def set_on_ground(
    before: Footing,
    legs: Legs,
    translation: Float,
    rotations: Float,
    floor: Floor,
) -> Grounded:
    """The next F frames of A agents on their ground.

    translation [A, F, 3], rotations [A, F, 22, 4], as they are on the flat floor.
    Many frames at once or in pieces, the result is the same; every agent's is its own.
    """
    pose = pose_legs(legs, translation, rotations)
    ankles = pose.ankle[:2] + translation.transpose(2, 1, 0)[:2, None]  # [2, 2, F, A]
    start = np.where(before.begun, before.ankles.T, ankles[:, :, 0])
    way = np.diff(np.concatenate([start[:, :, None], ankles], 2), axis=2)
    slopes = _followed(before.slope.T, _slopes(ankles, floor), TILT_SHARE)
    height = pose.soles[2].min(0)
    pose = _tilted(pose, translation, slopes)
    needed = np.maximum(
        height - _lowest(pose.soles, 0 * way, floor),
        height - _lowest(pose.soles, AHEAD * FPS * way, floor),
    )
    each = np.ascontiguousarray(needed.transpose(1, 0, 2))  # [F, 2, A]
    feet, lift = _sprung(before.feet.T, before.lift.T, each, FOOT_STIFFNESS)
    feet = feet.transpose(1, 0, 2)
    wanted = feet.mean(0) - CROUCH * np.abs(feet[0] - feet[1])
    hips, rise = _sprung(before.hips, before.rise, wanted, STIFFNESS)
    shift = np.zeros((3, *feet.shape), np.float32)
    shift[2] = feet - hips

    raised, turned = translation.astype(np.float32), rotations.astype(np.float32)
    raised[..., 2] += hips.T
    turned[:, :, MOVED] = move_ankles(pose, shift)
    after = Footing(
        hips=hips[-1].astype(np.float32),
        rise=rise.astype(np.float32),
        feet=feet[:, -1].T.astype(np.float32),
        lift=lift.T.astype(np.float32),
        slope=slopes[:, :, -1].T.astype(np.float32),
        ankles=ankles[:, :, -1].T.astype(np.float32),
        begun=np.ones(len(translation), np.bool_),
    )
    return Grounded(raised, turned, after)


def _followed(before: Array, wanted: Array, share: float) -> Array:
    """Values that go after `wanted` [..., F, A], a share of the way each frame, from `before`."""
    found, value = np.empty(wanted.shape, np.float32), before
    for frame in range(wanted.shape[-2]):
        value = value + share * (wanted[..., frame, :] - value)
        found[..., frame, :] = value
    return found


def _sprung(height: Array, rise: Array, wanted: Array, stiffness: float) -> tuple[Array, Array]:
    """Heights [F, ...] that a damped spring pulls to those `wanted`, and the last rise [...]."""
    found = np.empty(wanted.shape, np.float32)
    for frame, target in enumerate(wanted):
        rise = (rise + stiffness**2 * (target - height)) / (1 + stiffness) ** 2
        height = height + rise
        found[frame] = height
    return found, rise


def _slopes(ankles: Array, floor: Floor) -> Array:
    """Rise over run along x and y [2, 2, F, A] at ankles [2, 2, F, A]; 0 over a step's edge."""
    offsets = SPAN * np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
    heights = _sampled(ankles[:, None] + offsets[..., None, None, None], floor)  # [4, 2, F, A]
    slopes = np.stack([heights[0] - heights[1], heights[2] - heights[3]]) / (2 * SPAN)
    return np.where((np.abs(slopes) > STEEP).any(0), 0.0, slopes)


def _tilted(pose: LegPose, translation: Float, slopes: Array) -> LegPose:
    """The pose with its feet turned about their ankles, from level to slopes [2, 2, F, A]."""
    x, y = slopes
    # The shortest arc from the vertical to the ground's normal.
    turn = unit(stacked(y, -x, np.zeros_like(x), 1 + np.sqrt(1 + x * x + y * y)))
    ankle = (pose.ankle + translation.transpose(2, 1, 0)[:, None])[:, None]
    soles = ankle + rotate_points(turn, pose.soles - ankle)
    return replace(pose, ankle_turn=multiply(turn, pose.ankle_turn), soles=soles)


def _lowest(soles: Array, ahead: Array, floor: Floor) -> Array:
    """Least height [2, F, A] of soles [3, P, 2, F, A] above the floor, moved on [2, 2, F, A]."""
    found: Array = (soles[2] - _sampled(soles[:2] + ahead[:, None], floor)).min(0)
    return found


def _sampled(places: Array, floor: Floor) -> Array:
    """Heights [..., A] of the floor at places [2, ..., A]."""
    shape = places.shape[1:]
    return floor(places.reshape(2, -1, shape[-1]).T).T.reshape(shape)
