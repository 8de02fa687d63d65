"""Uneven ground: sent bodies stand on their scene's floor, whereas planned motion has a flat one.

    feet    raised so that their soles keep the distance to the floor that they have to z = 0, and
            turned with its slope; a swinging foot looks ahead to where it is about to be, so it is
            up before it comes over a step
    aim     downstairs a swinging foot is moved along its way to where all of its sole will be on
            one tread, and stays moved while it stands
    hips    raised smoothly, a little less than the feet where these are at different heights

Two-bone inverse kinematics bends the legs between them. Everything follows its target gradually,
frame by frame, also over the seams of chunks. Like the foot lock, it changes only what is sent.
World space, metres, 40 frames per second.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from wayfarer.spec import FPS
from wayfarer.world.output.legs import LegPose, Legs, pose_legs
from wayfarer.world.output.quaternion import (
    Array,
    length,
    multiply,
    rotate_points,
    stacked,
    unit,
)
from wayfarer.world.output.twobone import move_ankles
from wayfarer.world.rows import Flags, Float, Rows, Shape
from wayfarer.world.springs import approached, followed, sprung

Floor = Callable[[Array], Array]
"""Height of the floor at points [A, N, 2] of A agents. [A, N]"""

AHEAD: Final = 0.12
"""Seconds that a foot looks ahead."""

SLOPE_S: Final = 0.0416
"""Half-life in seconds of the turn of a foot to a slope."""

FOOT_S: Final = 0.0408
"""Half-life of the spring that lifts a foot."""

HIPS_S: Final = 0.1155
"""Half-life of the spring that lifts the hips."""

LEAD_S: Final = 0.0347
"""Half-life with which the hips' target follows the ground a little ahead of the feet. It is ahead
since the hips follow it with a delay.
"""

CROUCH: Final = (0.12, 0.19)
"""Share of the height between the feet by which the hips stay below the feet's mean, up and down
stairs: the foot that goes down first must reach the ground.
"""

SPAN: Final = 0.06
"""Metres to either side of an ankle between which the slope is taken."""

STEEP: Final = 1.0
"""Rise over run; anything steeper is the edge of a step rather than a slope."""

ACROSS: Final = np.arange(-0.20, 0.33, 0.04, dtype=np.float32)
"""Metres from the ankle, in the hips' facing, at which ends of treads are looked for."""

SOLE: Final = (-0.09, 0.15)
"""Range of `ACROSS` that a sole covers, in metres."""

AIM_SPEED: Final = 0.8
"""Maximum metres per second by which the shift of a foot in the air grows."""

EDGE: Final = 0.08
"""Metres that the ground falls between two of these points at the end of a tread."""

DOWN: Final = (0.02, 0.2)
"""Metres of its lowest point, and metres per second, below which a foot stands."""


@dataclass(slots=True, eq=False)
class Footing(Rows):
    """An agent's footing in the last frame shown."""

    hips: Float  # metres by which the hips are raised
    rise: Float  # change of `hips` in the last frame, metres
    feet: Annotated[Float, Shape(2)]  # metres by which the left and right foot are raised
    lift: Annotated[Float, Shape(2)]  # change of `feet` in the last frame, metres
    slope: Annotated[Float, Shape(2, 2)]  # rise over run along x and y to which each foot is turned
    ankles: Annotated[Float, Shape(2, 2)]  # their places, metres
    aim: Annotated[Float, Shape(2)]  # metres by which each foot is moved ahead
    lead: Annotated[Float, Shape(2)]  # metres by which the ground a little ahead would raise each
    begun: Flags  # whether `ankles` is valid


@dataclass(frozen=True, slots=True)
class Grounded:
    """Frames on the ground."""

    translation: Float  # [A, F, 3]
    rotations: Float  # [A, F, 22, 4]
    footing: Footing


def standing(floors: Sequence[float]) -> Footing:
    """The footing of agents that stand on floors at these heights."""
    footing = Footing.empty(len(floors))
    footing.hips[:] = floors
    footing.feet[:] = footing.lead[:] = footing.hips[:, None]
    return footing


def set_on_ground(
    before: Footing,
    legs: Legs,
    translation: Float,
    rotations: Float,
    floor: Floor,
) -> Grounded:
    """The next F frames of A agents on their ground.

    translation [A, F, 3] and rotations [A, F, 22, 4] are those on the flat floor. The result is the
    same for many frames at once or in pieces, and agents do not influence each other.
    """
    pose = pose_legs(legs, translation, rotations)
    ankles = pose.ankle.T[:2] + translation.transpose(2, 1, 0)[:2, None]  # [2, 2, F, A]
    start = np.where(before.begun, before.ankles.T, ankles[:, :, 0])
    way = np.diff(np.concatenate([start[:, :, None], ankles], 2), axis=2)
    height, facing = pose.soles.T[2].min(0), _facing(pose)
    offsets = _offsets(ankles + AHEAD * FPS * way, facing, floor)
    stands = (height < DOWN[0]) & (FPS * length(way) < DOWN[1])
    aim = approached(before.aim.T, offsets, stands, AIM_SPEED)
    moved = aim * facing
    ankles = ankles + moved
    slopes = followed(before.slope.T, _slopes(ankles, floor), SLOPE_S)
    pose, soles = _tilted(pose, translation, slopes, moved)
    ahead = height - _lowest(soles, AHEAD * FPS * way, floor)
    needed = np.maximum(height - _lowest(soles, 0 * way, floor), ahead)
    each = np.ascontiguousarray(needed.transpose(1, 0, 2))  # [F, 2, A]
    feet, lift = sprung(before.feet.T, before.lift.T, each, FOOT_S)
    feet = feet.transpose(1, 0, 2)
    lead = followed(before.lead.T, ahead, LEAD_S)
    # downstairs the hips must be as fast as the feet; upstairs the feet go first
    down = lead.mean(0) < feet.mean(0)
    crouch = np.where(down, CROUCH[1], CROUCH[0]) * np.abs(feet[0] - feet[1])
    wanted = np.minimum(feet.mean(0), lead.mean(0)) - crouch
    hips, rise = sprung(before.hips, before.rise, wanted, HIPS_S)
    shift = np.empty(pose.ankle.shape, np.float32)
    shift.T[:2], shift.T[2] = moved, feet - hips

    raised, turned = translation.astype(np.float32), np.array(rotations, np.float32, order="C")
    raised[..., 2] += hips.T
    move_ankles(pose, shift, turned)
    after = Footing(
        hips=hips[-1].astype(np.float32),
        rise=rise.astype(np.float32),
        feet=feet[:, -1].T.astype(np.float32),
        lift=lift.T.astype(np.float32),
        slope=slopes[:, :, -1].T.astype(np.float32),
        ankles=(ankles - moved)[:, :, -1].T.astype(np.float32),
        aim=aim[:, -1].T.astype(np.float32),
        lead=lead[:, -1].T.astype(np.float32),
        begun=np.ones(len(translation), np.bool_),
    )
    return Grounded(raised, turned, after)


def _offsets(landing: Array, facing: Array, floor: Floor) -> Array:
    """Metres ahead [2, F, A] at which a foot that lands there [2, 2, F, A] is on one tread.

    This is the nearest such place, or 0 if there is none or no tread ends. It applies only
    downstairs: upstairs a foot without room sticks out behind, as people's do.
    """
    along = landing[:, None] + ACROSS[:, None, None, None] * facing[:, None]
    edges = np.diff(_sampled(along, floor), axis=0) < -EDGE  # [P - 1, 2, F, A]
    found = np.zeros(edges.shape[1:], np.float32)
    free = np.zeros(edges.shape[1:], np.bool_)
    for offset, first, last in _WINDOWS:
        fits = ~free & ~edges[first:last].any(0)
        found[fits] = offset
        free |= fits
    return found


def _windows() -> list[tuple[float, int, int]]:
    """Offsets of a sole, nearest first, with the pieces of `ACROSS` that it then covers."""
    first, last = np.searchsorted(ACROSS, SOLE).tolist()
    step = float(ACROSS[1] - ACROSS[0])
    moves = range(-first, len(ACROSS) - last)
    return [(move * step, first + move, last + move) for move in sorted(moves, key=abs)]


_WINDOWS: Final = _windows()


def _slopes(ankles: Array, floor: Floor) -> Array:
    """Rise over run along x and y [2, 2, F, A] at ankles [2, 2, F, A]; 0 over a step's edge."""
    offsets = SPAN * np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
    heights = _sampled(ankles[:, None] + offsets[..., None, None, None], floor)  # [4, 2, F, A]
    slopes = np.stack([heights[0] - heights[1], heights[2] - heights[3]]) / (2 * SPAN)
    return np.where((np.abs(slopes) > STEEP).any(0), 0.0, slopes)


def _facing(pose: LegPose) -> Array:
    """Horizontal unit vectors [2, 1, F, A] that the hips face."""
    x, y, z, w = pose.root_turn.T[:, None]
    ahead = stacked(-2 * (x * y + z * w), 1 - 2 * (y * y + z * z))
    return ahead / np.maximum(length(ahead), 1e-9)


def _tilted(
    pose: LegPose, translation: Float, slopes: Array, moved: Array
) -> tuple[LegPose, Array]:
    """The pose with its feet turned about their ankles, from level to slopes [2, 2, F, A], and
    where its soles [3, P, 2, F, A] then are, `moved` [2, 2, F, A].
    """
    x, y = slopes
    # The shortest arc from the vertical to the ground's normal.
    turn = unit(stacked(y, -x, np.zeros_like(x), 1 + np.sqrt(1 + x * x + y * y)))
    ankle = (pose.ankle.T + translation.transpose(2, 1, 0)[:, None])[:, None]
    soles = ankle + rotate_points(turn, pose.soles.T - ankle)
    soles[:2] += moved[:, None]
    turned = np.ascontiguousarray(multiply(turn, pose.ankle_turn.T).T, np.float32)
    return pose._replace(ankle_turn=turned), soles


def _lowest(soles: Array, ahead: Array, floor: Floor) -> Array:
    """Minimum height [2, F, A] of soles [3, P, 2, F, A] above the floor, moved by [2, 2, F, A]."""
    found: Array = (soles[2] - _sampled(soles[:2] + ahead[:, None], floor)).min(0)
    return found


def _sampled(places: Array, floor: Floor) -> Array:
    """Heights [..., A] of the floor at places [2, ..., A]."""
    shape = places.shape[1:]
    return floor(places.reshape(2, -1, shape[-1]).T).T.reshape(shape)
