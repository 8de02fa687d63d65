"""Standing feet stay where they are: the drift of a standing agent is taken off every step.

The model lets both soles of a standing person creep by about a millimetre per step and turn by a
tenth of a degree, which adds up to 30 cm and 30 degrees in a minute. While an agent stands, its
feet are *planted*: the places of the sole markers are remembered, and every step is corrected:

    the new frames are moved and turned in the plane, as one rigid body, so that by the end of the
    step both feet together are back in their places;

    in the markers that the next step starts from, each leg is bent so that its own foot is exactly
    there: all of it at the sole, less the higher a marker is, nothing at the hips.

The next primitive follows those markers, so neither error builds up, and the foot lock, which works
on what is sent, only has the small motion within a step left to take off.

A foot that the model lifts ends this: the agent takes a real step, and its feet are planted where
they come to rest. World space, metres. Pure functions of columns: rows do not influence each other.
"""

from dataclasses import replace
from math import radians
from typing import Final, NamedTuple

import numpy as np

from wayfarer.runtime.feet.quaternion import bounded, multiply
from wayfarer.runtime.world.heading import facing_of
from wayfarer.runtime.world.rows import Flags, Float, Index
from wayfarer.runtime.world.slots import Gait, Mode, Seeds
from wayfarer.spec import NEW_FRAMES

MAX_SHIFT: Final = 0.03
"""Metres that one step is moved by at most: a larger error is taken off over several steps."""

MAX_TURN: Final = radians(2)
"""Radians that one step is turned by at most."""

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

_EASE: Final = (0.5 - 0.5 * np.cos(np.pi * np.arange(1, NEW_FRAMES + 1) / NEW_FRAMES)).astype(
    np.float32
)
"""Share of the correction in each new frame: nothing at the seam, all of it at the end."""


class Step(NamedTuple):
    """New frames of a step, and the markers that the next one starts from."""

    translation: Float  # [A, F, 3] hips
    rotations: Float  # [A, F, 22, 4]
    markers: Float  # [A, S, 67, 3] of the last S frames
    contacts: Flags  # [A, F, 2] left, right


class _Motion(NamedTuple):
    """A motion in the plane: about `centre` by radians `turn`, then by `shift`."""

    centre: Float  # [..., 2]
    turn: Float  # [...]
    shift: Float  # [..., 2]

    def moved(self, points: Float, share: Float) -> Float:
        """Points [..., 2] moved by a share [...] of it."""
        x, y = np.moveaxis(points - self.centre, -1, 0)
        cos, sin = np.cos(share * self.turn), np.sin(share * self.turn)
        turned = np.stack([cos * x - sin * y, sin * x + cos * y], -1)
        return turned + self.centre + share[..., None] * self.shift

    def spread(self, axes: int) -> "_Motion":
        """The same for each of several points: with so many axes more behind the first."""
        ones = (1,) * axes
        return _Motion(
            self.centre.reshape(len(self.centre), *ones, 2),
            self.turn.reshape(len(self.turn), *ones),
            self.shift.reshape(len(self.shift), *ones, 2),
        )


def plant(soles: Index, gait: Gait, seed: Seeds, step: Step) -> tuple[Gait, Step]:
    """The step with the drift of planted feet taken off, and the gait that remembers their places.

    soles [2, P]: the markers under the left and under the right foot; `gait` is that of the step,
    `seed` where it starts. Rows that do not stand on both feet are returned as they are.
    """
    stands = (gait.mode == Mode.STANDING) & step.contacts.all((1, 2))
    rows = np.flatnonzero(stands)
    if not len(rows):
        return replace(gait, planted=stands), step
    known = gait.planted[rows][:, None, None, None]
    begin = _closed(seed.markers[rows, -1][:, soles, :2], facing_of(seed.rotations[rows, -1, 0]))
    places = np.where(known, gait.soles[rows], begin)
    remembered = gait.soles.copy()
    remembered[rows] = places
    return replace(gait, planted=stands, soles=remembered), _corrected(step, rows, soles, places)


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


def _corrected(step: Step, rows: Index, soles: Index, places: Float) -> Step:
    """The step with `rows` brought back to the soles' `places` [R, 2, P, 2]."""
    translation, rotations, markers = (
        values.copy() for values in (step.translation, step.rotations, step.markers)
    )
    ends = markers[rows]
    pairs = (len(rows), -1, 2)
    found = ends[:, -1][:, soles, :2].reshape(pairs)
    both = _between(found, places.reshape(pairs), MAX_SHIFT, MAX_TURN)
    ease = np.broadcast_to(_EASE, (len(rows), NEW_FRAMES))
    translation[rows, :, :2] = both.spread(1).moved(translation[rows, :, :2], ease)

    half = ease * both.turn[:, None] / 2
    turn = np.zeros((4, *half.shape), np.float32)
    turn[2], turn[3] = np.sin(half), np.cos(half)
    hips = np.moveaxis(rotations[rows, :, 0], -1, 0)
    rotations[rows, :, 0] = np.moveaxis(multiply(turn, hips), 0, -1)

    last = ease[:, -ends.shape[1] :, None]
    ends[..., :2] = both.spread(2).moved(ends[..., :2], np.broadcast_to(last, ends.shape[:3]))
    markers[rows] = _bent(ends, soles, places)
    return Step(translation, rotations, markers, step.contacts)


def _bent(markers: Float, soles: Index, places: Float) -> Float:
    """Markers [R, S, 67, 3] with each leg bent so that its sole ends at its place [R, 2, P, 2].

    A marker goes with the foot that it is nearer to, seen from above; in between, with both.
    """
    found = markers[:, -1][:, soles, :2]  # [R, 2, P, 2]
    left, right = (_distance(markers[..., :2], found[:, foot]) for foot in (0, 1))
    to_right = bounded(2 * left / np.maximum(left + right, 1e-6) - 0.5, 0, 1)
    low = bounded(1 - markers[..., 2] / LEG_HEIGHT, 0, 1)
    bent = markers.copy()
    for foot, share in enumerate((1 - to_right, to_right)):
        own = _between(found[:, foot], places[:, foot], MAX_STRIDE, MAX_TWIST).spread(2)
        bent[..., :2] += own.moved(markers[..., :2], low * share) - markers[..., :2]
    return bent


def _distance(points: Float, sole: Float) -> Float:
    """Metres [R, S, M] from points [R, S, M, 2] to a sole [R, P, 2]: its line from heel to toe."""
    heel, foot = sole[:, None, None, 0], (sole[:, -1] - sole[:, 0])[:, None, None]
    along = ((points - heel) * foot).sum(-1) / np.maximum((foot * foot).sum(-1), 1e-6)
    distance: Float = np.linalg.norm(
        points - heel - bounded(along, 0, 1)[..., None] * foot, axis=-1
    )
    return distance


def _between(found: Float, wanted: Float, most: float, most_turn: float) -> _Motion:
    """The motion that brings points [R, P, 2] nearest to where they are wanted, within bounds."""
    centre = found.mean(1)
    shift = wanted.mean(1) - centre
    far = np.linalg.norm(shift, axis=-1, keepdims=True)
    a, b = found - centre[:, None], wanted - wanted.mean(1)[:, None]
    crossed = (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]).sum(-1)
    turn = bounded(np.arctan2(crossed, (a * b).sum((-1, -2))), -most_turn, most_turn)
    return _Motion(centre, turn, shift * np.minimum(1, most / np.maximum(far, 1e-9)))
