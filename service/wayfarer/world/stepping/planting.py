"""Standing feet stay where they are: the drift of a standing agent is taken off every step.

The model lets both soles of a standing person creep by about a millimetre per step and turn by a
tenth of a degree, which adds up to 30 cm and 30 degrees in a minute. While an agent stands, its
feet are *planted*: the places of the sole markers are remembered, and every step is corrected:

    the new frames are moved and turned in the plane, as one rigid body, so that by the end of the
    step both feet together are back in their places;

    the same motion turns a person who stands back to the heading at which he came to a stand, if
    his hips have turned away from it over his feet, as the model lets them, by 12 degrees and more
    in half a minute; a few degrees are left to him;

    in the markers that the next step starts from, each leg is bent so that its own foot is exactly
    there: all of it at the sole, less the higher a marker is, nothing at the hips.

The next primitive follows those markers, so neither error builds up, and the foot lock, which works
on what is sent, only has the small motion within a step left to take off.

Agents that go in *side steps*, facing elsewhere, are carried: the same standing body is moved on,
with the places of its feet, and the foot lock makes steps of that. The model itself squats and
floats when it is asked to walk sideways.

A foot that the model lifts ends this: the agent takes a real step, and its feet are planted where
they come to rest. World space, metres. Pure functions of columns: rows do not influence each other.
"""

from dataclasses import replace
from math import radians
from typing import Final, NamedTuple

import numpy as np

from wayfarer.spec import NEW_FRAMES, SEED_FRAMES, STEP_SECONDS
from wayfarer.world.agents.heading import facing_of
from wayfarer.world.agents.slots import Gait, Mode, Seeds
from wayfarer.world.output.quaternion import bounded
from wayfarer.world.rows import Flags, Float, Index
from wayfarer.world.stepping.plane import PlaneMotion, yawed

MAX_SHIFT: Final = 0.03
"""Metres that one step is moved by at most: a larger error is taken off over several steps."""

MAX_TURN: Final = radians(2)
"""Radians that one step is turned by at most."""

AWRY: Final = radians(1.5)
"""Radians off his heading within which a person who stands may face …"""

BACK: Final = (0.4, radians(1.5))
"""… and beyond which a step takes off this share, at most so many radians: the model pushes back
by up to a degree a step, where it starts from a pose that it would not stand in."""

MAX_STRIDE: Final = 0.06
"""Metres that a foot of its own is moved by at most in one step, …"""

MAX_TWIST: Final = radians(6)
"""… and radians that it is turned by."""

STRIDE: Final = 0.05
"""Metres that a foot may be ahead of the other when a person has come to a stand."""

WIDTH: Final = (0.14, 0.26)
"""Metres between the middles of both soles, aside, within which they are left."""

LEG_HEIGHT: Final = 0.8
"""Metres: a marker this high is not moved with a foot; below, the lower the more."""

EASE: Final = (0.5 - 0.5 * np.cos(np.pi * np.arange(1, NEW_FRAMES + 1) / NEW_FRAMES)).astype(
    np.float32
)
"""Share of the correction in each new frame: nothing at the seam, all of it at the end."""


class Step(NamedTuple):
    """New frames of a step, and the markers that the next one starts from."""

    translation: Float  # [A, F, 3] hips
    rotations: Float  # [A, F, 22, 4]
    markers: Float  # [A, S, 67, 3] of the last S frames
    contacts: Flags  # [A, F, 2] left, right


def plant(
    soles: Index, gait: Gait, seed: Seeds, step: Step, carried: Float
) -> tuple[Gait, Step, Seeds]:
    """The step with the drift of planted feet taken off, where the next one starts, and the gait
    that remembers the places of the feet.

    soles [2, P]: the markers under the left and under the right foot; `gait` is that of the step,
    `seed` where it starts, `carried` [A, 2] the velocity in side steps at its end. Rows that do not
    stand on both feet are returned as they are.
    """
    on_the_spot = (gait.mode == Mode.STANDING) | (gait.mode == Mode.STRAFING)
    stands = (on_the_spot | (gait.mode == Mode.STOPPING) & gait.planted) & step.contacts.all((1, 2))
    rows = np.flatnonzero(stands)
    velocity = np.where(stands[:, None], carried, 0).astype(np.float32)
    after = replace(gait, planted=stands, carried=velocity)
    if not len(rows):
        return after, step, end_of(step)
    known = gait.planted[rows][:, None, None, None]
    begin = _closed(seed.markers[rows, -1][:, soles, :2], facing_of(seed.rotations[rows, -1, 0]))
    places = np.where(known, gait.soles[rows], begin)
    way = _way(gait.carried[rows], velocity[rows])
    after.soles = gait.soles.copy()
    after.soles[rows] = places + way[:, None, None, -1]
    facing = facing_of(step.rotations[rows, -1, 0])
    back = _back(facing, gait.stop_facing[rows]) * (gait.mode[rows] == Mode.STANDING)
    return after, *_corrected(step, rows, soles, places, way, back)


def _back(facing: Float, asked: Float) -> Float:
    """Radians [R] by which a step turns who faces [R, 2] back towards what is `asked` [R, 2]."""
    crossed = facing[:, 0] * asked[:, 1] - facing[:, 1] * asked[:, 0]
    off = np.arctan2(crossed, (facing * asked).sum(-1))
    share, most = BACK
    back: Float = bounded(share * (off - bounded(off, -AWRY, AWRY)), -most, most)
    return back


def end_of(step: Step) -> Seeds:
    """Where the next step starts."""
    return Seeds(step.markers, step.translation[:, -SEED_FRAMES:], step.rotations[:, -SEED_FRAMES:])


def _way(before: Float, after: Float) -> Float:
    """Way [R, F, 2] of bodies whose velocity changes evenly from `before` to `after` [R, 2]."""
    share = (np.arange(1, NEW_FRAMES + 1, dtype=np.float32) / NEW_FRAMES)[:, None]
    mean = before[:, None] + share / 2 * (after - before)[:, None]
    return (STEP_SECONDS * share * mean).astype(np.float32)


def _closed(soles: Float, facing: Float) -> Float:
    """Places [R, 2, P, 2] for soles found [R, 2, P, 2] of bodies that face [R, 2]: feet together.

    A foot that is left behind comes up to the other, as people close a stop; neither moves
    when they are side by side already.
    """
    right = np.stack([facing[:, 1], -facing[:, 0]], -1)
    between = soles[:, 1].mean(1) - soles[:, 0].mean(1)  # from the left to the right foot
    ahead, aside = (between * facing).sum(-1), (between * right).sum(-1)
    close = np.where(np.abs(ahead) > STRIDE, np.abs(ahead), 0)
    wide = bounded(aside, *WIDTH) - aside
    shift = np.stack([close * (ahead > 0), close * (ahead < 0)], -1)[..., None] * facing[:, None]
    shift += (np.stack([-wide, wide], -1) / 2)[..., None] * right[:, None]
    closed: Float = soles + shift[:, :, None].astype(np.float32)
    return closed


def _corrected(
    step: Step, rows: Index, soles: Index, places: Float, way: Float, back: Float
) -> tuple[Step, Seeds]:
    """The step with `rows` brought back to the soles' `places` [R, 2, P, 2] and turned `back` [R],
    then on their way.

    The next step starts from a body at rest: the model does not know that it is carried.
    """
    translation, rotations, markers = (
        values.copy() for values in (step.translation, step.rotations, step.markers)
    )
    ends = markers[rows]
    pairs = (len(rows), -1, 2)
    found = ends[:, -1][:, soles, :2].reshape(pairs)
    both = _between(found, places.reshape(pairs), MAX_SHIFT, MAX_TURN)
    both = both._replace(turn=both.turn + back)

    hips, root = step.translation[rows, :, :2], step.rotations[rows, :, 0]
    ease, all_ = np.broadcast_to(EASE, hips.shape[:2]), np.ones(hips.shape[:2], np.float32)
    moved = both.spread(1)
    translation[rows, :, :2] = moved.moved(hips, ease) + way
    rotations[rows, :, 0] = yawed(root, ease * both.turn[:, None])
    seed = end_of(Step(translation, rotations, markers, step.contacts))
    last = slice(-SEED_FRAMES, None)
    seed = Seeds(markers, seed.translation.copy(), seed.rotations.copy())
    seed.translation[rows, :, :2] = moved.moved(hips[:, last], all_[:, last]) + way[:, -1:]
    seed.rotations[rows, :, 0] = yawed(root[:, last], all_[:, last] * both.turn[:, None])
    ends[..., :2] = both.spread(2).moved(ends[..., :2], np.ones((1, 1, 1), np.float32))
    ends[..., :2] += way[:, -1, None, None]
    markers[rows] = _bent(ends, soles, places + way[:, None, None, -1])
    return Step(translation, rotations, markers, step.contacts), seed


def _bent(markers: Float, soles: Index, places: Float) -> Float:
    """Markers [R, S, 67, 3] with each leg bent so that its sole ends at its place [R, 2, P, 2].

    A marker goes with the foot that it is nearer to, seen from above; in between, with both.
    """
    found = markers[:, -1][:, soles, :2]  # [R, 2, P, 2]
    x, y = (np.ascontiguousarray(markers[..., axis]) for axis in (0, 1))  # [R, S, 67]
    left, right = (_distance(x, y, found[:, foot]) for foot in (0, 1))
    to_right = bounded(2 * left / np.maximum(left + right, 1e-6) - 0.5, 0, 1)
    low = bounded(1 - markers[..., 2] / LEG_HEIGHT, 0, 1)
    bent = markers.copy()
    for foot, share in enumerate((1 - to_right, to_right)):
        own = _between(found[:, foot], places[:, foot], MAX_STRIDE, MAX_TWIST).spread(2)
        to_x, to_y = own.moved_xy(x, y, low * share)
        bent[..., 0] += to_x - x
        bent[..., 1] += to_y - y
    return bent


def _distance(x: Float, y: Float, sole: Float) -> Float:
    """Metres from points, [R, S, M] each, to a sole [R, P, 2]: its line from heel to toe."""
    heel_x, heel_y = np.moveaxis(sole[:, 0, :, None, None], 1, 0)  # [R, 1, 1] each
    foot_x, foot_y = np.moveaxis((sole[:, -1] - sole[:, 0])[..., None, None], 1, 0)
    dx, dy = x - heel_x, y - heel_y
    long = np.maximum(foot_x * foot_x + foot_y * foot_y, 1e-6)
    along = bounded((dx * foot_x + dy * foot_y) / long, 0, 1)
    dx, dy = dx - along * foot_x, dy - along * foot_y
    return np.sqrt(dx * dx + dy * dy)


def _between(found: Float, wanted: Float, most: float, most_turn: float) -> PlaneMotion:
    """The motion that brings points [R, P, 2] nearest to where they are wanted, within bounds."""
    centre = found.mean(1)
    shift = wanted.mean(1) - centre
    far = np.linalg.norm(shift, axis=-1, keepdims=True)
    a, b = found - centre[:, None], wanted - wanted.mean(1)[:, None]
    crossed = (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]).sum(-1)
    turn = bounded(np.arctan2(crossed, (a * b).sum((-1, -2))), -most_turn, most_turn)
    return PlaneMotion(centre, turn, shift * np.minimum(1, most / np.maximum(far, 1e-9)))
