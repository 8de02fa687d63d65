"""Guards: a step that no body could take is repaired before it is sent, or continued from.

    knees   are kept within what a knee can do, and so are ankles
    jerks   a joint that jumps, as one that is turned inside out does, goes from where it was to
            where it ends by the smoothest way
    feet    the turns of a leg whose foot jumps, which none of them need do alone, are smoothed
    falls   a body that leans or squats as no walker does, or that cannot be shown at all, gets up
            to a stand in the course of one step

Repairs are rare; without one the output has the same bits. Pure functions of
columns; rows do not influence each other. Angles in radians, frames at 40 per second.
"""

from math import cos, radians, sin
from typing import Final

import numpy as np

from wayfarer.body.skeleton import joint_names
from wayfarer.spec import NEW_FRAMES, POSED_JOINTS, SEED_FRAMES
from wayfarer.world.agents.slots import Motion, Seeds
from wayfarer.world.output.legs import ANKLES, HIPS, KNEES, Legs, pose_legs
from wayfarer.world.output.quaternion import Array, bounded, inverse, length, multiply, stacked
from wayfarer.world.rows import Flags, Float

KNEE: Final = (radians(-5), radians(150))
"""Range of a knee's bend, from straight."""

SIDEWAYS: Final = radians(30)
"""Angle that a knee is turned by at most beside its bend: people reach 31 degrees."""

ANKLE: Final = radians(70)
"""Angle that an ankle is turned by at most, in any direction: people reach 66 degrees."""

FELL: Final = cos(radians(32))
"""Cosine of the lean beyond which a body has fallen; walking people never lean as far."""

FOLDED: Final = 0.76
"""Share of its standing hips' height below which a body has fallen."""

ARM_MOST: Final = radians(60)
"""Angle by which a joint of an arm turns at most while a body gets up."""

JERK: Final = {
    "spine": 5.0, "neck": 12.0, "head": 15.0, "collar": 7.0, "shoulder": 8.0, "elbow": 15.0,
    "wrist": 25.0, "hip": 5.0, "knee": 7.0, "ankle": 25.0, "foot": 40.0,
}  # fmt: skip
"""Degrees per frame by which the turning of a joint may change from frame to frame: what hangs on
it then moves by about 7 cm per frame²."""


def _limits() -> Float:
    """Limits [22] of the squared second difference of quaternions, which is half the angle's."""
    found = np.full(POSED_JOINTS, np.inf)
    for number, name in enumerate(joint_names()[1:POSED_JOINTS], start=1):
        part = name.split("_")[-1].rstrip("123")
        found[number] = (radians(JERK[part]) / 2) ** 2
    return found.astype(np.float32)


_LIMITS: Final = _limits()

WHIP: Final = 0.06
"""Metres per frame² by which the way of a foot may change: …"""

REACHES: Final = (0.9, 0.5, 0.14)
"""… its middle is about so far from hip, knee and ankle, metres."""

_LEG: Final = (HIPS, KNEES, ANKLES)

EVENNESS: Final = 2.0
"""Weight of the second differences of what is smoothed, against its changes."""


def smoothed(seed: Seeds, translation: Float, rotations: Float, legs: Legs) -> Float:
    """Rotations [A, F, 22, 4] of a step from `seed`, without impossible knees and jerks; its hips
    are at translation [A, F, 3].
    """
    able = _turnable(_bendable(rotations, legs))
    path = np.concatenate([seed.rotations, able], 1)
    jerks = _jerks(path).max(1)  # [A, 22]
    unjerked = _unjerked(able, path, jerks > _LIMITS)
    if unjerked is not able:
        path = np.concatenate([seed.rotations, unjerked], 1)
        jerks = _jerks(path).max(1)
    return _unwhipped(seed, translation, unjerked, path, jerks, legs)


def _unjerked(rotations: Float, path: Float, over: Flags) -> Float:
    """The same where joints [A, 22] that are `over` their limits go another way than `path`."""
    if not over.any():
        return rotations
    rows, joints = np.nonzero(over)
    paths = _alike(path[rows, :, joints])
    before = _jerks(paths).max(1)
    smooth = _smoothest(paths)
    # where a joint came fast and ends near by, that way is the more abrupt one
    after = _jerks(np.concatenate([paths[:, :SEED_FRAMES], smooth], 1)).max(1)
    better = (before > _LIMITS[joints]) & (after < before)
    if not better.any():
        return rotations
    rows, joints = rows[better], joints[better]
    mended = rotations.copy()
    mended[rows, :, joints] = smooth[better]
    return mended


def _unwhipped(
    seed: Seeds, translation: Float, rotations: Float, path: Float, jerks: Float, legs: Legs
) -> Float:
    turning = 2 * np.sqrt(jerks)  # [A, 22] radians per frame²
    farthest = sum(arm * turning[:, joints] for arm, joints in zip(REACHES, _LEG, strict=True))
    rows = np.flatnonzero(np.any(farthest > WHIP, -1))
    if not len(rows):  # nearly always: nobody need be posed
        return rotations
    hips = np.concatenate([seed.translation[rows], translation[rows]], 1)
    feet = pose_legs(legs.take(rows), hips, path[rows]).soles.mean(1)  # [3, 2, S + F, R]
    whips = length(np.diff(feet, 2, axis=2)).max(1) > WHIP  # [2, R]
    if not whips.any():
        return rotations
    mended = rotations.copy()
    for joints in _LEG:
        side, which = np.nonzero(whips)
        joint = np.array(joints)[side]
        mended[rows[which], :, joint] = _even(_alike(path[rows[which], :, joint]))
    return mended


def _even(path: Float) -> Float:
    """New turns [N, F, 4] of paths [N, S + F, 4] with smaller second differences and the same end:
    the least squares of changes and second differences (Whittaker 1923).
    """
    even = sum(share[:, None] * path[:, None, frame] for frame, share in enumerate(_WHITTAKER.T))
    found: Float = even / np.linalg.norm(even, axis=-1, keepdims=True)
    return found


def _whittaker() -> Float:
    """The new frames from all of a path [F, S + F]."""
    total = SEED_FRAMES + NEW_FRAMES
    bends = np.diff(np.eye(total), 2, axis=0)
    system = np.eye(total) + EVENNESS * bends.T @ bends
    free = slice(SEED_FRAMES, total - 1)
    known = np.eye(total)[free]
    known[:, :SEED_FRAMES] -= system[free, :SEED_FRAMES]
    known[:, -1] -= system[free, -1]
    end = np.eye(total)[-1:]
    solved = np.linalg.solve(system[free, free], known)
    return np.concatenate([solved, end]).astype(np.float32)


_WHITTAKER: Final = _whittaker()


def _jerks(path: Float) -> Float:
    """Squared second differences [N, F, ...] of turns [N, 2 + F, ..., 4]."""
    turns = path[:, 1:] - path[:, :-1]
    change = turns[:, 1:] - turns[:, :-1]
    change *= change  # in place, as the sum: these arrays are the largest there are
    squared: Float = change[..., 0] + change[..., 1]
    squared += change[..., 2]
    squared += change[..., 3]
    return squared


def _alike(path: Float) -> Float:
    """Turns [N, F, 4] with the signs that are nearest to each other: both of a quaternion mean the
    same turn, and one that passes half a turn comes with the other.
    """
    flips = (path[:, 1:] * path[:, :-1]).sum(-1) < 0
    signs = np.cumprod(np.where(flips, np.float32(-1), np.float32(1)), axis=1)
    alike = path.copy()
    alike[:, 1:] *= signs[..., None]
    return alike


def _smoothest(path: Float) -> Float:
    """Turns [N, F, 4] between the second and the last of a joint's path [N, 2 + F, 4]: the cubic
    that begins and ends as fast as that path does.
    """
    turns = np.moveaxis(path, -1, 0).astype(np.float64)
    start = turns[:, :, 1]
    whole = _vector(multiply(inverse(start), turns[:, :, -1]))
    into = _vector(multiply(inverse(turns[:, :, 0]), start))
    out = _vector(multiply(inverse(turns[:, :, -2]), turns[:, :, -1]))
    frames = path.shape[1] - 2
    fast = np.maximum(length(whole), 1e-6) * 3 / frames
    into, out = (v * np.minimum(1, fast / np.maximum(length(v), 1e-9)) for v in (into, out))
    t = np.arange(1, frames + 1) / frames
    way = (
        whole[..., None] * (3 * t**2 - 2 * t**3)
        + frames * into[..., None] * (t - 2 * t**2 + t**3)
        + frames * out[..., None] * (t**3 - t**2)
    )
    found: Float = np.moveaxis(multiply(start[..., None], _turn(way)), 0, -1).astype(np.float32)
    return found


def _turn(vector: Array) -> Array:
    """Rotations [4, ...] about vectors [3, ...] by as many radians as these are long."""
    angle = np.maximum(length(vector), 1e-12)
    return np.concatenate([vector / angle * np.sin(angle / 2), np.cos(angle / 2)[None]])


def _vector(turn: Array) -> Array:
    """Axis times angle [3, ...] of rotations [4, ...], the shorter way round."""
    turn = turn * np.where(turn[3] < 0, -1, 1)
    sine = length(turn[:3])
    angle = 2 * np.arctan2(sine, turn[3])
    vector: Array = turn[:3] * (angle / np.maximum(sine, 1e-12))
    return vector


def _bendable(rotations: Float, legs: Legs) -> Float:
    """The same with knees bent within `KNEE`, and no more than `SIDEWAYS` beside it."""
    knees = np.moveaxis(rotations[:, :, KNEES], -1, 0)  # [4, A, F, 2]
    _, y, z, _ = knees
    beside = y * y + z * z
    if twisted := bool((beside > sin(SIDEWAYS / 2) ** 2).any()):
        knees = _straightened(knees, beside)
    bend = _flexion(knees, legs)
    low, high = KNEE
    excess = bend - bounded(bend, low, high)
    if not (twisted or excess.any()):
        return rotations
    half = excess / 2
    zero = np.zeros_like(half)
    limited = rotations.copy()
    turned = multiply(stacked(np.sin(half), zero, zero, np.cos(half)), knees)
    limited[:, :, KNEES] = np.moveaxis(np.where(excess == 0, knees, turned), 0, -1)
    return limited


def _straightened(knees: Array, beside: Array) -> Array:
    """Knees [4, A, F, 2] with as much of their turn about Y and Z left as they have; `beside` is
    the square of that part.
    """
    most = sin(SIDEWAYS / 2) ** 2
    less = np.sqrt(np.minimum(1, most / np.maximum(beside, 1e-12)))
    more = np.sqrt((1 - less * less * beside) / np.maximum(1 - beside, 1e-6))
    x, y, z, w = knees
    return np.where(beside > most, stacked(more * x, less * y, less * z, more * w), knees)


def _turnable(rotations: Float) -> Float:
    """The same with ankles turned by `ANKLE` at most."""
    ankles = rotations[:, :, ANKLES]
    scalar = np.abs(ankles[..., 3])
    if not (far := scalar < cos(ANKLE / 2)).any():
        return rotations
    nearer = ankles * np.where(ankles[..., 3:] < 0, -1, 1)
    nearer[..., :3] *= sin(ANKLE / 2) / np.sqrt(np.maximum(1 - scalar**2, 1e-12))[..., None]
    nearer[..., 3] = cos(ANKLE / 2)
    limited = rotations.copy()
    limited[:, :, ANKLES] = np.where(far[..., None], nearer, ankles)
    return limited


def _flexion(knees: Array, legs: Legs) -> Array:
    """Radians that knees [4, A, F, 2] are bent from straight, -90° … 270°: a knee that is beyond
    straight by more than a quarter turn has been folded through the thigh.
    """
    rest = np.moveaxis(legs.ankle, -1, 0)[:, :, None]  # [3, A, 1, 2] from the knee
    x, y, z, w = knees
    ahead = 2 * (x * y + w * z) * rest[0] + (1 - 2 * (x * x + z * z)) * rest[1]
    ahead += 2 * (y * z - w * x) * rest[2]
    up = 2 * (x * z - w * y) * rest[0] + 2 * (y * z + w * x) * rest[1]
    up += (1 - 2 * (x * x + y * y)) * rest[2]
    bend = np.arctan2(-ahead, -up) - np.arctan2(-rest[1], -rest[2])
    found: Array = (bend + np.pi / 2) % (2 * np.pi) - np.pi / 2
    return found


def fallen(translation: Float, rotations: Float, legs: Legs) -> Flags:
    """Bodies [A] that lean or squat at the end of their step: [A, F, 3], [A, F, 22, 4]."""
    upright, hips = bearing(translation, rotations, legs)
    found: Flags = (upright < FELL) | (hips < FOLDED)
    return found


def bearing(translation: Float, rotations: Float, legs: Legs) -> tuple[Float, Float]:
    """How upright bodies [A] are at the end of their step, as the cosine of their lean, and how
    high their hips, as a share of what they are in a stand: [A, F, 3], [A, F, 22, 4].
    """
    trunk = np.moveaxis(rotations[:, -1, [0, *_SPINE]], -1, 0)  # [4, A, 4]
    turn = trunk[:, :, 0]
    upright = np.zeros(len(translation), np.float32)
    for joint in range(1, 4):
        turn = multiply(turn, trunk[:, :, joint])
        x, y, _, _ = turn
        upright += (1 - 2 * (x * x + y * y)) / 3
    heel = legs.sole_of_ankle[:, :, 0, 2]
    height = -(legs.hip + legs.knee + legs.ankle)[..., 2].mean(1) - heel.mean(1)
    return upright, translation[:, -1, 2] / height


_SPINE: Final = [joint_names().index(f"spine{k}") for k in (1, 2, 3)]


def got_up(seed: Seeds, stand: Motion) -> tuple[Float, Float]:
    """Translation [A, F, 3] and rotations [A, F, 22, 4] from the end of `seed` to a `stand`.

    Arms that have farther to go than `ARM_MOST` get there with the next step: `stand` is changed to
    show them where they have come to.
    """
    t = (np.arange(1, NEW_FRAMES + 1) / NEW_FRAMES)[:, None]
    start, end = seed.translation[:, -1:], stand.seed.translation[:, -1:]
    speed = start - seed.translation[:, -2:-1]  # nobody who falls stops at once
    translation = start + (3 * t**2 - 2 * t**3) * (end - start)
    translation += NEW_FRAMES * (t - 2 * t**2 + t**3) * speed

    last = np.moveaxis(seed.rotations[:, -1], -1, 0)  # [4, A, 22]
    way = _vector(multiply(inverse(last), np.moveaxis(stand.seed.rotations[:, -1], -1, 0)))
    way[:, :, _ARMS] *= np.minimum(1, ARM_MOST / np.maximum(length(way[:, :, _ARMS]), 1e-9))
    end_turns = np.moveaxis(multiply(last, _turn(way)), 0, -1)[:, None]
    path = np.concatenate([seed.rotations, np.repeat(end_turns, NEW_FRAMES, axis=1)], 1)
    turns = np.stack([_smoothest(row.swapaxes(0, 1)).swapaxes(0, 1) for row in path])
    stand.seed.rotations[:, :, _ARMS] = turns[:, -1:, _ARMS]
    return translation.astype(np.float32), turns


_ARMS: Final = [
    number
    for number, name in enumerate(joint_names()[:POSED_JOINTS])
    if name.split("_")[-1] in ("shoulder", "elbow", "wrist")
]
