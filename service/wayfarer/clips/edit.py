"""Changes of a finished clip: another frame rate, root motion apart, a cycle that repeats.

Root motion is the travelled path, averaged over a step, with the heading: what moves a capsule.
Taking the hips themselves would take out their surge and sway with each step, too.
"""

from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.library import load_body
from wayfarer.body.rotation import (
    inverse,
    matrix_from_quaternion,
    multiply,
    quaternion_from_rotvec,
    rotvec_from_quaternion,
)
from wayfarer.clips.clip import Clip
from wayfarer.errors import InvalidArgument

Array = NDArray[np.floating[Any]]

FASTEST: Final = 240.0
"""Most frames per second of a file."""
AVERAGED_S: Final = 0.35
"""Standard deviation in seconds of the average that makes the travelled path:
a stride leaves an eighth of its sway in it."""
FLAT_M: Final = 0.04
"""The ground under a path counts as level if it varies less."""
PERIOD_S: Final = (0.7, 2.5)
"""Least and greatest length of a cycle: two steps, from running to strolling."""
CYCLE_M: Final = 0.12
"""Mean distance of joints, in metres, up to which two frames count as the same pose."""
MIN_SPEED: Final = 0.3
"""Metres per second below which nobody walks."""


@dataclass(frozen=True)
class RootTrack:
    """The travelled path, frame by frame: world space, metres."""

    places: Array = field(repr=False)  # [N, 3] on the ground
    headings: Array = field(repr=False)  # [N] radians about +Z, continuous; 0 faces +Y

    @property
    def turns(self) -> Array:
        """Rotations [N, 4]."""
        half = self.headings / 2
        zero = np.zeros_like(half)
        return np.stack([zero, zero, np.sin(half), np.cos(half)], -1)


def check_rate(fps: float) -> None:
    """Raises InvalidArgument for a rate out of range."""
    if not 1 <= fps <= FASTEST:
        raise InvalidArgument(f"fps is {fps:g}; allowed are 1 to {FASTEST:g}", "fps")


def resampled(clip: Clip, fps: float) -> Clip:
    """The same motion at another rate: straight lines and shortest arcs between frames.

    Raises InvalidArgument for a rate out of range.
    """
    check_rate(fps)
    if fps == clip.fps:
        return clip
    count = int(round((clip.frames - 1) / clip.fps * fps, 6)) + 1
    at = np.minimum(np.arange(count) / fps * clip.fps, clip.frames - 1)
    before = np.minimum(at.astype(int), max(clip.frames - 2, 0))
    after = np.minimum(before + 1, clip.frames - 1)
    share = (at - before)[:, None]
    places, turns = clip.translation, np.asarray(clip.rotations, np.float64)
    first = turns[before]
    between = rotvec_from_quaternion(multiply(inverse(first), turns[after]))
    return replace(
        clip,
        translation=places[before] * (1 - share) + places[after] * share,
        rotations=multiply(first, quaternion_from_rotvec(between * share[..., None])),
        contacts=clip.contacts[np.where(share[:, 0] < 0.5, before, after)],
        fps=fps,
    )


def root_track(clip: Clip, loops: bool = False) -> RootTrack:
    """The path that the clip travels; `loops`: the clip repeats from its last frame on."""
    from scipy.ndimage import gaussian_filter1d  # only files need it: not loaded at start

    points, headings = _raw_root(clip)
    width = AVERAGED_S * clip.fps
    if loops:  # the cycles before and after, so that the average repeats, too
        points, headings = _repeated(points, headings)
    else:
        pad = int(4 * width)  # carried on beyond both ends by a half turn about them
        points = np.pad(points, ((pad, pad), (0, 0)), "reflect", reflect_type="odd")
        headings = np.pad(headings, pad, "reflect", reflect_type="odd")
    start = (len(points) - clip.frames) // 2
    own = slice(start, start + clip.frames)
    smooth = gaussian_filter1d(points, width, axis=0, mode="nearest")[own]
    level = float(np.median(smooth[:, 2]))
    if np.ptp(smooth[:, 2]) < FLAT_M:
        smooth[:, 2] = 0.0 if abs(level) < FLAT_M else level
    return RootTrack(smooth, gaussian_filter1d(headings, width, mode="nearest")[own])


def relative_to(clip: Clip, root: RootTrack) -> Clip:
    """The clip as seen from its root: in place, facing +Y."""
    back = inverse(root.turns)
    offset = np.asarray(clip.translation, np.float64) - root.places
    turns = np.array(clip.rotations, np.float64)
    turns[:, 0] = multiply(back, turns[:, 0])
    moved = np.einsum("nab,nb->na", matrix_from_quaternion(back), offset)
    return replace(clip, translation=moved, rotations=turns)


def put_back(clip: Clip, root: RootTrack) -> Clip:
    """The inverse of `relative_to`."""
    turns = np.array(clip.rotations, np.float64)
    turns[:, 0] = multiply(root.turns, turns[:, 0])
    moved = np.einsum("nab,nb->na", matrix_from_quaternion(root.turns), clip.translation)
    return replace(clip, translation=root.places + moved, rotations=turns)


def looped(clip: Clip) -> Clip:
    """A cycle of steady walking in the clip: its last frame is its first, plus the travel.

    Its ends are the two most similar frames two steps apart, and their difference is spread
    over the cycle. Raises InvalidArgument when the clip has no two such frames.
    """
    if clip.seconds <= PERIOD_S[0]:
        raise _no_cycle(clip.seconds)
    root = root_track(clip)
    still = relative_to(clip, root)
    body = load_body(clip.body, clip.gender, "low")
    joints = still.pose(body)[1][:, : clip.rotations.shape[1]]
    speeds = np.gradient(joints, 1 / clip.fps, axis=0)
    start, end = _alike(joints, speeds, root, clip.fps)
    cycle = still[start : end + 1]
    share = _ramp(cycle.frames)[:, None, None]
    turns: Array = np.asarray(cycle.rotations, np.float64)
    off = rotvec_from_quaternion(multiply(inverse(turns[-1]), turns[0]))
    turns = multiply(turns, quaternion_from_rotvec(off * share))
    shift = (cycle.translation[0] - cycle.translation[-1]) * share[..., 0]
    path = RootTrack(root.places[start : end + 1], root.headings[start : end + 1])
    closed = replace(cycle, translation=cycle.translation + shift, rotations=turns)
    contacts = closed.contacts.copy()
    contacts[-1] = contacts[0]
    return put_back(replace(closed, contacts=contacts), path)


def _ramp(count: int) -> Array:
    """0 … 1, without a corner at its ends [N]."""
    x = np.linspace(0, 1, count)
    return np.asarray(x * x * (3 - 2 * x))


def _alike(joints: Array, speeds: Array, root: RootTrack, fps: float) -> tuple[int, int]:
    """First and last frame of the best cycle. Raises InvalidArgument."""
    count = len(joints)
    travel = np.linalg.norm(np.gradient(root.places, 1 / fps, axis=0), axis=-1)
    walks = travel > MIN_SPEED
    best: tuple[float, int, int] | None = None
    for gap in range(int(PERIOD_S[0] * fps), min(int(PERIOD_S[1] * fps), count - 1) + 1):
        apart = np.linalg.norm(joints[gap:] - joints[:-gap], axis=-1).mean(-1)
        faster = np.linalg.norm(speeds[gap:] - speeds[:-gap], axis=-1).mean(-1)
        steady = np.abs(travel[gap:] - travel[:-gap])
        usable = walks[gap:] & walks[:-gap] & (apart < CYCLE_M)
        cost = np.where(usable, apart + 0.1 * faster + 0.1 * steady, np.inf)
        k = int(cost.argmin())
        if np.isfinite(cost[k]) and (best is None or cost[k] < best[0]):
            best = (float(cost[k]), k, k + gap)
    if best is None:
        raise _no_cycle(count / fps)
    return best[1:]


def _no_cycle(seconds: float) -> InvalidArgument:
    return InvalidArgument(
        f"no cycle was found in {seconds:.1f} s: a loop wants a few seconds of steady walking in "
        "one direction, e.g. one goal 10 m away and 8 s",
        "loop",
    )


def _raw_root(clip: Clip) -> tuple[Array, Array]:
    """Ground point [N, 3] under the hips and their heading [N], frame by frame."""
    body = load_body(clip.body, clip.gender, "low")
    rest = body.rest_joints(np.asarray(clip.betas))
    _, places = clip.pose(body)
    feet = [body.joint_names.index(f"{side}_{b}") for side in ("left", "right") for b in _FEET]
    ground = (places[:, feet, 2] - rest[feet, 2]).min(1)
    points = np.concatenate([clip.translation[:, :2], ground[:, None]], 1).astype(np.float64)
    ahead = matrix_from_quaternion(np.asarray(clip.rotations[:, 0], np.float64))[:, :, 1]
    return points, np.unwrap(np.arctan2(-ahead[:, 0], ahead[:, 1]))


_FEET: Final = ("ankle", "foot")


def _repeated(points: Array, headings: Array) -> tuple[Array, Array]:
    """Two cycles before, this one, and two after: each begins where the last one ended."""
    turn = headings[-1] - headings[0]
    path, facing = points, headings
    for k in (1, 2):
        before = _carried(points, path[0], points[-1], -k * turn)
        after = _carried(points, path[-1], points[0], k * turn)
        path = np.concatenate([before[:-1], path, after[1:]])
        facing = np.concatenate([headings[:-1] - k * turn, facing, headings[1:] + k * turn])
    return path, facing


def _carried(points: Array, to: Array, start: Array, turn: float) -> Array:
    """Points turned about the vertical and moved, so that `start` comes to lie at `to`."""
    cosine, sine = np.cos(turn), np.sin(turn)
    about_z = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    return np.asarray((points - start) @ about_z.T + to)
