"""Whether a walk's pace is a person's: a wrong frame rate makes it half or twice as fast.

People take longer steps when they take quicker ones, so the ratio of step length to cadence
hardly changes from a stroll to a run (the walk ratio). A walk at half its rate has steps of the
same length at half the cadence: twice the ratio. A walk at twice its rate has the cadence of a
run, in which people swing their heels up; walkers do not.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.floor import ANKLES
from wayfarer_lab.training.mocap.rig import SourceClip, leg_length
from wayfarer_lab.training.mocap.selection import smoothed
from wayfarer_lab.training.mocap.skeleton import Array

SLOWEST = 0.35  # leg lengths a second: slower is standing and shifting
AHEAD = 0.8  # least cosine between the way and the facing: sideways steps follow another rule
PASSED = 0.1  # leg lengths by which a foot must pass the other for a step
STEPS = 5  # fewer say little
MAX_RATIO = 2.0  # recordings: median 1.45, at most 1.86 in 107 walks
MAX_WALKING_CADENCE = 3.1  # steps/s
RUNNING_LIFT = 0.28  # leg lengths; walks 0.13 to 0.27, quick runs from 0.27 on


@dataclass(frozen=True)
class Pace:
    """The forward walking of a clip."""

    steps: int
    speed: float  # m/s
    cadence: float  # steps/s
    ratio: float  # step length over cadence, in legs and times of the root of leg over gravity
    lift: float  # how high the ankles swing above where they stand, leg lengths


def pace(clip: SourceClip) -> Pace | None:
    """The pace of a clip's forward walking; None if it has less than `STEPS` steps of it."""
    leg = leg_length(clip.rest)
    hips = smoothed(clip.places[:, 0, :2], 21)
    velocity = np.gradient(hips, axis=0) * FPS
    speed = np.linalg.norm(velocity, axis=-1)
    facing = clip.rotations[:, 0, :2, 1]
    facing = facing / np.maximum(np.linalg.norm(facing, axis=-1, keepdims=True), 1e-9)
    ahead = (velocity * facing).sum(-1) > AHEAD * speed
    apart = clip.places[:, ANKLES[0], :2] - clip.places[:, ANKLES[1], :2]
    passed = _steps((apart * facing).sum(-1) / leg)
    walking = ahead & (speed > SLOWEST * leg)
    # whole steps: from one passing of the feet to the next, walked throughout
    whole = [(a, b) for a, b in itertools.pairwise(passed) if walking[a:b].all()]
    if len(whole) < STEPS:
        return None
    seconds = sum(b - a for a, b in whole) / FPS
    way = sum(float(speed[a:b].sum()) for a, b in whole) / FPS
    cadence = len(whole) / seconds
    unit = np.sqrt(leg / 9.81)
    heights = clip.places[:, ANKLES, 2]
    swing = np.concatenate([heights[a:b].max(-1) for a, b in whole])
    lift = float(np.percentile(swing, 90) - np.percentile(heights, 10)) / leg
    return Pace(len(whole), way / seconds, cadence, way / len(whole) / leg / (cadence * unit), lift)


def _steps(lead: Array) -> list[int]:
    """Frames at which a foot passes the other, having been behind it by `PASSED`."""
    found, side = [], 0
    for k, x in enumerate(lead):
        if abs(x) > PASSED and np.sign(x) != side:
            if side:
                found.append(k)
            side = int(np.sign(x))
    return found


def odd_pace(clip: SourceClip) -> str | None:
    """The fault of a clip's pace, if there is one; only locomotion is judged."""
    found = pace(clip) if clip.info.locomotion else None
    if found is None:
        return None
    if found.ratio > MAX_RATIO:
        guess = "half"
    elif found.cadence > MAX_WALKING_CADENCE and found.lift < RUNNING_LIFT:
        guess = "twice"
    else:
        return None
    return (
        f"{clip.info.name}: walks at {found.speed:.2f} m/s with {found.cadence:.1f} steps a "
        f"second, as people do not: is its frame rate {guess} the true one? The column `fps` of "
        "the index corrects it"
    )
