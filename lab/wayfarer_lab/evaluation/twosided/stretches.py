"""Stretches of a take in which somebody does a certain thing, found by how the body moves."""

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS
from wayfarer_lab.evaluation.figures import smooth_speed
from wayfarer_lab.evaluation.maneuvers import recorded
from wayfarer_lab.evaluation.metrics import feet
from wayfarer_lab.evaluation.takes import ELBOWS, WRISTS, Take
from wayfarer_lab.training.mocap.selection import Use

Uses = NDArray[np.uint8]
"""`selection.Use` of each frame [T]."""
Stretches = Iterator[Take]

PLANTED: Final = 0.05
"""Maximum way of an ankle in a stand, metres."""

LOW: Final = 0.04
"""Maximum height of a sole above the floor in a stand, metres."""

FOOT_SPEED: Final = 0.25
"""Maximum speed of an ankle in a stand, m/s."""

STANDS: Final = 3 * FPS
"""Minimum length in frames of a stand."""

MAX_STAND: Final = 20 * FPS
"""Length in frames at which longer stands are cut."""

RADIUS: Final = (1.2, 3.2)
"""Radii (m) of the curves that are compared with one of 2 m."""

CURVE_SPEED: Final = (0.8, 1.6)
"""Speeds (m/s) of these curves."""

CURVES: Final = round(1.5 * FPS)

BACK: Final = 130.0
"""Minimum degrees of a turn that counts as turning back."""

BACK_SECONDS: Final = 2.5
"""Maximum time of turning back."""

WALKS: Final = 0.5
"""Minimum speed (m/s) of the walk before and after turning back."""


def stands(take: Take, use: Uses) -> Stretches:
    """Stands of 3 s and more: feet in their places, hands below the elbows, nothing acted."""
    speed = np.linalg.norm(np.gradient(take.ankles, axis=0), axis=-1).max(-1) * FPS
    below = (take.joints[:, WRISTS, 2] < take.joints[:, ELBOWS, 2]).all(-1)
    calm = smooth_speed(take.hips) < recorded.STROLLING
    acts = (use == Use.EXCLUDED) | (use == Use.OTHER)
    low = (take.height < LOW).all(-1)
    for run in feet.runs(~acts & below & calm & low & (speed < FOOT_SPEED)):
        for start in range(run.start, run.stop - STANDS + 1, MAX_STAND):
            part = take[start : min(start + MAX_STAND, run.stop)]
            apart = np.linalg.norm(part.ankles - np.median(part.ankles, 0), axis=-1)
            if len(part) >= STANDS and apart.max() < PLANTED:
                yield part


def walks(low: float, high: float) -> Callable[[Take, Uses], Stretches]:
    """Straight walks at a speed between two, m/s."""

    def found(take: Take, use: Uses) -> Stretches:
        for speed, part in recorded.straight(take, use):
            if low <= speed < high:
                yield part

    return found


def nowhere(take: Take, use: Uses) -> Stretches:
    """Finds nothing, for situations that no recording has."""
    yield from ()


def sideways(take: Take, use: Uses) -> Stretches:
    """Steps to either side."""
    yield from (part for case, part in recorded.strafes(take, use) if case != "back")


def backward(take: Take, use: Uses) -> Stretches:
    """Walks backward."""
    yield from (part for case, part in recorded.strafes(take, use) if case == "back")


def turns(take: Take, use: Uses) -> Stretches:
    """Turns on the spot."""
    yield from (part for _, part in recorded.turns(take, use))


def stops(take: Take, use: Uses) -> Stretches:
    """Walks that end in a rest."""
    yield from (part for _, part in recorded.stops(take, use))


def starts(take: Take, use: Uses) -> Stretches:
    """Walks ahead out of a stand: up to a second of the stand, and up to 2 s of the walk."""
    if len(take) < 2 * FPS:
        return
    speed = smooth_speed(take.hips)
    for run in feet.runs(speed < 0.08):
        begun, end = run.stop, min(run.stop + 2 * FPS, len(take))
        part = slice(max(begun - FPS, run.start), end)
        if run.stop - run.start < FPS // 2 or end - begun < FPS or not (use[part] > 0).all():
            continue
        velocity = take.hips[end - 1, :2] - take.hips[begun, :2]
        ahead = float((velocity * take.facing[begun]).sum())
        if speed[begun:end].max() > 0.7 and ahead > 0.7 * np.linalg.norm(velocity):
            yield take[part]


def curves(take: Take, use: Uses) -> Stretches:
    """Curves of 1.2 to 3.2 m of radius at .8 to 1.6 m/s."""
    if len(take) < CURVES:
        return
    velocity = recorded.velocity_of(take, 1.0)
    speed = np.linalg.norm(velocity, axis=-1)
    way = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    turning = recorded.smooth(np.gradient(way) * FPS, 1.0)
    for sign in (1, -1):
        radius = speed / np.maximum(sign * turning, 1e-3)
        curved = (
            (radius > RADIUS[0])
            & (radius < RADIUS[1])
            & (speed > CURVE_SPEED[0])
            & (speed < CURVE_SPEED[1])
            & (recorded.off_way(take, velocity) < 40)
            & (use > 0)
        )
        yield from recorded.parts(take, curved, CURVES)


def turns_back(take: Take, use: Uses) -> Stretches:
    """Turns by 130° and more within 2.5 s between two walks, with .5 s before and after them."""
    frames = round(BACK_SECONDS * FPS)
    if len(take) < frames + 2 * FPS:
        return
    speed, turned = smooth_speed(take.hips), take.heading
    done = np.abs(turned[frames:] - turned[:-frames]) > BACK
    end = 0
    for run in feet.runs(done):
        # the frame at which half of the turn is done
        middle = (run.start + run.stop - 1 + frames) // 2
        part = slice(middle - frames // 2 - FPS // 2, middle + frames // 2 + FPS // 2)
        if part.start < end or part.start < 0 or part.stop > len(take):
            continue
        ahead = (np.gradient(take.hips[:, :2], axis=0) * take.facing).sum(-1) * FPS
        fast = min(speed[part][: FPS // 2].max(), speed[part][-FPS // 2 :].max()) > WALKS
        forward = min(ahead[part][: FPS // 2].mean(), ahead[part][-FPS // 2 :].mean()) > 0.3
        if fast and forward and (use[part] > 0).all():
            end = part.stop
            yield take[part]
