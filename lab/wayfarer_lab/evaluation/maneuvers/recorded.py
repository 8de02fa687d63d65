"""Recorded people who perform the manoeuvres, cut out of prepared recordings.

The motion of the body decides what a person does, not the name of the clip. Only frames that
are in use (`training.mocap.selection`) count. Bodies are male: a clip is prepared on both, and
counting it twice would make the sample look larger than it is.
"""

from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.library import load_body
from wayfarer.clips.clip import Clip
from wayfarer.errors import InvalidArgument
from wayfarer.spec import FPS
from wayfarer_lab.evaluation.maneuvers import crowd, likeness, robust, stand, stop, turn, walk
from wayfarer_lab.evaluation.maneuvers.maneuver import RECORDED, Maneuver, MeasuredTake
from wayfarer_lab.evaluation.metrics import feet
from wayfarer_lab.evaluation.takes import Take
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.store import ClipRange, Dataset
from wayfarer_lab.training.mocap.upper import PLAIN as PLAIN_UPPER

Array = NDArray[np.floating[Any]]
Flags = NDArray[np.bool_]
Uses = NDArray[np.uint8]
"""`Use` of each frame [T]."""

PLAIN: Final = ("walk", "crowd", "likeness", "random")
"""Manoeuvres with enough recordings without acted styles."""

GENDER: Final = "male"
HELDOUT: Final = f"{RECORDED}, held out"
"""The split that nothing is trained on; it has its own rows."""

MIN_FRAMES: Final = FPS
"""Shortest take in frames: 1 s."""

SIDEWAYS: Final = (55.0, 125.0)
BACKWARD: Final = 145.0
"""Degrees between facing and way."""

STROLLING: Final = 0.25
"""Metres per second: slower is standing."""

STANDING: Final = 3 * FPS
"""Shortest stand in frames."""

TURNING: Final = 20.0
"""Degrees per second over 0.5 s: slowest turn."""

TURNED: Final[dict[str, tuple[float, float]]] = {"90°": (60.0, 135.0), "180°": (135.0, 225.0)}
"""Degrees, and the case that they count to."""

ON_THE_SPOT: Final = 0.4
"""Metres that hips move in a turn on the spot at most."""

WALKED: Final = 0.5
"""Metres per second within 3 s before a stop."""

HALF: Final = FPS // 2
"""Frames on either side over which way and speed of a walk are taken: a second in all."""

STRAIGHT: Final = 12.0
"""Degrees by which the way of a straight walk may change in a second."""

EVEN: Final = 0.3
"""Metres per second by which the speed of a straight walk may change."""

AHEAD: Final = 25.0
"""Largest angle between facing and way of a straight walk, in degrees."""

STRETCH: Final = 2 * FPS
"""Shortest straight walk in frames."""


class RecordedClips:
    """The recordings of a prepared data folder, as recorded, each clip once."""

    def __init__(self, folder: Path, *, legs: bool = False) -> None:
        """`legs`: also clips of acted styles that got a plain upper body (`mocap.upper`), of which
        the legs are recorded.

        Raises DataError when it is not a prepared folder, InvalidArgument when it has no clips as
        recorded.
        """
        wanted = ("", PLAIN_UPPER) if legs else ("",)
        self._data = Dataset.load(folder)
        self._clips = [
            clip
            for clip in self._data.clips
            if clip.gender == GENDER and clip.shape == "own" and clip.augmentation in wanted
        ]
        if not self._clips:
            raise InvalidArgument(f"{folder} has no {GENDER} clips as recorded", "data")

    def __call__(self, maneuver: Maneuver) -> dict[tuple[str, str], list[MeasuredTake]]:
        """Takes by (case, source): those of all splits, and of them the held-out ones."""
        cutter = CUTTERS.get(maneuver.name)
        found: dict[tuple[str, str], list[MeasuredTake]] = {}
        if cutter is None:
            return found
        for clip, take, use in self._takes:
            if maneuver.name in PLAIN and clip.acted:
                continue
            for case, part in cutter(take, use):
                shot = MeasuredTake(part)
                found.setdefault((case, RECORDED), []).append(shot)
                if clip.split == "heldout":
                    found.setdefault((case, HELDOUT), []).append(shot)
        order = [case.name for case in maneuver.cases]
        return dict(sorted(found.items(), key=lambda item: order.index(item[0][0])))

    @cached_property
    def _takes(self) -> list[tuple[ClipRange, Take, Uses]]:
        return list(self.takes())

    def takes(self, split: str = "") -> Iterator[tuple[ClipRange, Take, Uses]]:
        """Every clip of a split, or of all, as a take, one after the other."""
        body, data = load_body("anny52", GENDER, "low"), self._data
        for clip in self._clips:
            if split not in ("", clip.split):
                continue
            frames = slice(clip.start, clip.stop)
            whole = Clip(
                data.translation[frames],
                data.rotations[frames],
                data.contacts[frames],
                clip.gender,
                clip.betas,
            )
            take = Take.of(whole, body, f"{clip.split}/{clip.name}", person_of(clip))
            yield clip, take, data.use[frames]


def person_of(clip: ClipRange) -> str:
    """The person of a clip: the subject, and for acted styles also the style."""
    return f"{clip.subject} {clip.style}".strip()


Cut = Iterator[tuple[str, Take]]
"""Case and part of a take."""


def smooth(values: Array, seconds: float) -> Array:
    """Moving mean of values [T, ...], centred on each frame; shorter at the ends."""
    frames = max(round(seconds * FPS), 1)
    kernel = np.ones(frames)
    count = np.convolve(np.ones(len(values)), kernel, "same")
    flat = values.reshape(len(values), -1)
    means = [np.convolve(column, kernel, "same") / count for column in flat.T]
    return np.stack(means, -1).reshape(values.shape)


def velocity_of(take: Take, seconds: float) -> Array:
    """Horizontal velocity of the hips, m/s. [T, 2]"""
    return smooth(np.gradient(take.hips[:, :2], axis=0) * FPS, seconds)


def off_way(take: Take, velocity: Array) -> Array:
    """Degrees between facing and way. [T]"""
    speed = np.linalg.norm(velocity, axis=-1)
    cosine = (velocity * take.facing).sum(-1) / np.maximum(speed, 1e-6)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def parts(take: Take, flags: Flags, shortest: int) -> Iterator[Take]:
    """Runs of flags [T] of `shortest` frames and more."""
    for run in feet.runs(flags):
        if run.stop - run.start >= shortest:
            yield take[run]


def strafes(take: Take, use: Uses) -> Cut:
    """Stretches sideways and backward."""
    if len(take) < MIN_FRAMES:
        return
    velocity = velocity_of(take, 0.5)
    off = off_way(take, velocity)
    goes = (np.linalg.norm(velocity, axis=-1) > STROLLING) & (use > 0)
    right = (velocity * np.stack([take.facing[:, 1], -take.facing[:, 0]], -1)).sum(-1) > 0
    sideways = goes & (off > SIDEWAYS[0]) & (off < SIDEWAYS[1])
    for case, flags in (
        ("left", sideways & ~right),
        ("right", sideways & right),
        ("back", goes & (off > BACKWARD)),
    ):
        for part in parts(take, flags, MIN_FRAMES):
            yield case, part


def stands(take: Take, use: Uses) -> Cut:
    """Stretches of quiet standing."""
    for part in parts(take, use == Use.STANDING, STANDING):
        yield stand.STAND.cases[0].name, part


def turns(take: Take, use: Uses) -> Cut:
    """Turns on the spot, with half a second on either side."""
    if len(take) < MIN_FRAMES:
        return
    rate = smooth(np.gradient(take.heading) * FPS, 0.5)
    around = FPS // 2
    for sign in (1, -1):
        for run in feet.runs((sign * rate > TURNING) & (use > 0)):
            turned = abs(take.heading[run.stop - 1] - take.heading[run.start])
            apart = np.linalg.norm(take.hips[run, :2] - take.hips[run.start, :2], axis=-1).max()
            toes = feet.heading(take.soles[run])
            if apart > ON_THE_SPOT or np.abs(toes[-1] - toes[0]).mean() < turned / 2:
                continue  # on the way, or a twist of the trunk
            part = slice(max(run.start - around, 0), min(run.stop + around, len(take)))
            for case, (low, high) in TURNED.items():
                if low <= turned < high and (use[part] > 0).all():
                    yield case, take[part]


def stops(take: Take, use: Uses) -> Cut:
    """Walks that end in a rest of a second, from two seconds before it on."""
    if len(take) < 3 * FPS:
        return
    speed = np.linalg.norm(velocity_of(take, 0.5), axis=-1)
    for begun in stop.rests(take):
        before = slice(max(begun - 3 * FPS, 0), begun)
        end = min(begun + round((stop.AFTER + 0.1) * FPS), len(take))
        part = slice(max(begun - 2 * FPS, 0), end)
        if begun < FPS or speed[before].max() <= WALKED:
            continue
        if (use[part] > 0).mean() > 0.9:
            yield stop.STOP.cases[0].name, take[part]


def straight(take: Take, use: Uses) -> Iterator[tuple[float, Take]]:
    """Steady, straight walks and their mean speeds."""
    if len(take) < STRETCH:
        return
    time = np.arange(len(take))
    before, after = np.maximum(time - HALF, 0), np.minimum(time + HALF, len(take) - 1)
    velocity = (take.hips[after, :2] - take.hips[before, :2]) * FPS / (after - before)[:, None]
    speed = np.linalg.norm(velocity, axis=-1)
    way = np.degrees(np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0])))
    steady = (
        (np.abs(way[after] - way[before]) < STRAIGHT)
        & (np.abs(speed[after] - speed[before]) < EVEN)
        & (speed > 0.4)
        & (off_way(take, velocity) < AHEAD)
        & (use == Use.LOCOMOTION)
    )
    for part in parts(take, steady, STRETCH):
        metres = np.linalg.norm(part.hips[-1, :2] - part.hips[0, :2])
        yield float(metres) * FPS / (len(part) - 1), part


def walks(take: Take, use: Uses) -> Cut:
    """Straight walks by speed."""
    for speed, part in straight(take, use):
        for case, (low, high) in walk.SPEEDS.items():
            if low <= speed < high:
                yield case, part


def alike(take: Take, use: Uses) -> Cut:
    """Straight walks at any speed that is compared."""
    for speed, part in straight(take, use):
        if likeness.SPEEDS[0] <= speed < likeness.SPEEDS[1]:
            yield likeness.CASE, part


def crowds(take: Take, use: Uses) -> Cut:
    """Straight walks at people's own speed."""
    low, high = walk.SPEEDS[walk.USUAL]
    for speed, part in straight(take, use):
        if low <= speed < high:
            yield crowd.CROWD.cases[1].name, part


def everything(take: Take, use: Uses) -> Cut:
    """All locomotion, since no recordings follow such orders."""
    for part in parts(take, use == Use.LOCOMOTION, MIN_FRAMES):
        yield robust.RANDOM.cases[0].name, part


CUTTERS: Final[dict[str, Callable[[Take, Uses], Cut]]] = {
    "strafe": strafes,
    turn.TURN.name: turns,
    stand.STAND.name: stands,
    stop.STOP.name: stops,
    walk.WALK.name: walks,
    crowd.CROWD.name: crowds,
    likeness.LIKENESS.name: alike,
    robust.RANDOM.name: everything,
}
