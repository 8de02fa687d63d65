"""Which frames are worth learning from, and as what.

`use` per frame: EXCLUDED (crouched, bent, spinning, airborne acting, props), LOCOMOTION, STANDING
(quiet: both feet down, arms down), OTHER (upright acting, useful as variety).
"""

from enum import IntEnum

import numpy as np

from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.floor import BALLS, speeds
from wayfarer_lab.training.mocap.rig import J, SourceClip, leg_length
from wayfarer_lab.training.mocap.skeleton import Array

EXCLUDED_CATEGORIES = frozenset(
    [
        "run_obstacle",
        "walk_uneven",
        "jump",
        "dance_acrobatics",
        "martial_arts",
        "sport",
        "sit_prop",
        "climb_prop",
    ]
)
MIN_HIP_HEIGHT = 0.88  # of the clip's standing hip height: lower is a crouch
MIN_RUN_HIP_HEIGHT = 0.80  # runners bend their knees more
MAX_PELVIS_TILT = np.deg2rad(30)
MAX_TRUNK_LEAN = np.deg2rad(35)
MAX_SIDE_LEAN = np.sin(np.deg2rad(15))  # more than a tight turn asks for
MAX_YAW_RATE = 5.0  # rad/s, over a quarter second
MAX_BALL_HEIGHT = 0.6  # metres: higher is a kick or a flight
MAX_AIRBORNE = round(0.2 * FPS)  # frames without a foot down at walking speed: a hop, or bad data
QUIET_HIPS_SPEED = 0.12  # m/s
QUIET_JOINT_SPEED = 0.5  # m/s, hands included
MAX_STANCE = 0.4  # metres from ball to ball
HANGING = 0.12  # metres above the hips that hanging hands may be
MAX_ARM_SPREAD = 0.3  # metres over the floor from a wrist to the hip of its side
MIN_QUIET = round(0.3 * FPS)  # frames: a shorter stretch is a pause, not standing


class Use(IntEnum):
    """The use of a frame in training."""

    EXCLUDED = 0
    LOCOMOTION = 1
    STANDING = 2
    OTHER = 3


def smoothed(values: Array, frames: int = 9) -> Array:
    """Moving average over time (axis 0), edges held."""
    half = frames // 2
    padded = np.concatenate([values[:1]] * half + [values] + [values[-1:]] * half)
    sums = np.cumsum(np.concatenate([np.zeros_like(padded[:1]), padded]), axis=0)
    return (sums[frames:] - sums[:-frames]) / frames


def heading(rotations: Array) -> Array:
    """Unwrapped heading [N] in radians of the pelvis (0 faces +Y) from rotations [N, 22, 3, 3]."""
    forward = rotations[:, 0, :2, 1]
    return np.unwrap(np.arctan2(-forward[:, 0], forward[:, 1]))


def upright(clip: SourceClip) -> Array:
    """Frames [N] of ordinary standing, walking, running or turning on a flat floor."""
    hips = clip.places[:, [J["left_hip"], J["right_hip"]]].mean(1)
    trunk = clip.places[:, J["neck"]] - hips
    tall = hips[:, 2] / leg_length(clip.rest)
    fast = speeds(smoothed(hips)) > 1.8
    low = np.where(fast, MIN_RUN_HIP_HEIGHT, MIN_HIP_HEIGHT)
    tilt = np.arccos(np.clip(clip.rotations[:, 0, 2, 2], -1, 1))
    lean = np.arccos(np.clip(trunk[:, 2] / np.linalg.norm(trunk, axis=-1), -1, 1))
    right = clip.rotations[:, 0, :2, 0]
    sideways = (trunk[:, :2] * right).sum(-1) / np.linalg.norm(trunk, axis=-1)
    turning = np.abs(np.gradient(smoothed(heading(clip.rotations)))) * FPS
    balls = clip.places[:, BALLS, 2]
    airborne = _long_runs(~clip.contacts.any((1, 2)) & ~fast, MAX_AIRBORNE)
    return ~airborne & (
        (tall > low)
        & (tilt < MAX_PELVIS_TILT)
        & (lean < MAX_TRUNK_LEAN)
        & (np.abs(sideways) < MAX_SIDE_LEAN)
        & (turning < MAX_YAW_RATE)
        & (balls.max(-1) < MAX_BALL_HEIGHT)
        & (balls.min(-1) < 0.15)
    )


def quiet(clip: SourceClip) -> Array:
    """Frames [N] of natural standing: feet down and side by side, body still, arms hanging."""
    hips = clip.places[:, [J["left_hip"], J["right_hip"]]].mean(1)
    feet = clip.places[:, BALLS]
    spread = np.linalg.norm(feet[:, 0, :2] - feet[:, 1, :2], axis=-1)
    wrists = clip.places[:, [J["left_wrist"], J["right_wrist"]]]
    sides = clip.places[:, [J["left_hip"], J["right_hip"]]]
    spread_arms = np.linalg.norm((wrists - sides)[..., :2], axis=-1).max(-1)
    standing = (
        clip.contacts.all((1, 2))
        & (speeds(smoothed(hips)) < QUIET_HIPS_SPEED)
        & (speeds(smoothed(clip.places)).max(-1) < QUIET_JOINT_SPEED)
        & (spread < MAX_STANCE)
        & (wrists[..., 2].max(-1) < hips[:, 2] + HANGING)
        & (spread_arms < MAX_ARM_SPREAD)
    )
    return _long_runs(standing & upright(clip), MIN_QUIET)


def classify(clip: SourceClip) -> Array:
    """`Use` of each frame [N] uint8."""
    use = np.full(len(clip), Use.EXCLUDED, np.uint8)
    info = clip.info
    if info.scene_contact:
        return use
    if info.locomotion:
        use[upright(clip)] = Use.LOCOMOTION
    elif info.category not in EXCLUDED_CATEGORIES:
        use[upright(clip)] = Use.OTHER
    use[quiet(clip)] = Use.STANDING
    return use


def useful_stretches(use: Array, shortest: int) -> list[tuple[int, int]]:
    """Ranges of frames in use, joined over excluded gaps of up to a second."""
    frames = np.flatnonzero(use)
    if not len(frames):
        return []
    groups = np.split(frames, np.flatnonzero(np.diff(frames) > FPS) + 1)
    stretches = [(int(g[0]), int(g[-1]) + 1) for g in groups]
    return [(a, b) for a, b in stretches if b - a >= shortest]


def _long_runs(flags: Array, shortest: int) -> Array:
    """Only the runs of True that last at least `shortest` frames."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    kept = np.zeros(len(flags), bool)
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        if b - a >= shortest:
            kept[a:b] = True
    return kept
