"""The height of the floor, and when each part of a foot stands on it.

Everything is seen at the ball-of-foot joints (`left_foot`, `right_foot`) and the ankles.
Floor convention: z = 0 is the height of a standing foot's ball joint.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import minimum_filter1d

from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.rig import J
from wayfarer_lab.training.mocap.skeleton import Array

BALLS = [J["left_foot"], J["right_foot"]]
ANKLES = [J["left_ankle"], J["right_ankle"]]
STILL = 0.3  # m/s: a joint slower than this may be standing
MAX_TILT = np.deg2rad(2.5)
TILT_PRIOR = np.deg2rad(1.2)  # spread of floor tilts that we expect
MIN_SPREAD = 0.3  # metres of standard deviation over the floor, in both directions


def speeds(points: Array) -> Array:
    """Speed [N, ...] in m/s of points [N, ..., 3] at 40 fps, central differences."""
    if len(points) < 2:
        return np.zeros(points.shape[:-1])
    return np.linalg.norm(np.gradient(points, axis=0), axis=-1) * FPS


def standing_balls(places: Array) -> Array:
    """Places [K, 3] of ball joints while they stand: still, and low for this clip."""
    balls = places[:, BALLS]
    still = speeds(balls) < STILL
    chosen = balls[still] if still.sum() >= 4 else balls.reshape(-1, 3)
    return chosen[chosen[:, 2] < np.percentile(chosen[:, 2], 5) + 0.06]


def fit_tilt(clips: list[Array]) -> Array:
    """Rotation [3, 3] that levels a subject's floor, from the places [N, 22, 3] of their clips.

    A robust plane through the standing ball joints, each clip with its own height, pulled
    towards level by `TILT_PRIOR`. Identity when the standing points do not span the floor
    (people acting on the spot) or the plane tilts more than `MAX_TILT`.
    """
    points = [standing_balls(c) for c in clips]
    points = [p for p in points if len(p) >= 8]
    if not points:
        return np.eye(3)
    flat = np.concatenate([p[:, :2] - p[:, :2].mean(0) for p in points])
    height = np.concatenate([p[:, 2] - np.median(p[:, 2]) for p in points])
    if np.sqrt(np.linalg.eigvalsh(np.cov(flat.T))[0]) < MIN_SPREAD:
        # one direction is not covered: a plane through a line is not determined
        spread, axes = np.linalg.eigh(np.cov(flat.T))
        flat = flat @ axes[:, spread > MIN_SPREAD**2] @ axes[:, spread > MIN_SPREAD**2].T
        if not (spread > MIN_SPREAD**2).any():
            return np.eye(3)
    noise = 0.01
    weight = np.ones(len(height))
    slope = np.zeros(2)
    for _ in range(20):
        # steps of one stance are repeated measurements: count about one in ten
        normal = (flat * weight[:, None]).T @ flat / (10 * noise**2) + np.eye(2) / TILT_PRIOR**2
        slope = np.linalg.solve(normal, (flat * weight[:, None]).T @ height / (10 * noise**2))
        residual = height - flat @ slope
        weight = 1 / (1 + (residual / (2 * noise)) ** 2)
    if np.linalg.norm(slope) > MAX_TILT:
        return np.eye(3)
    normal_vector = np.array([-slope[0], -slope[1], 1.0])
    return rotation_between(normal_vector / np.linalg.norm(normal_vector), np.array([0.0, 0, 1]))


def rotation_between(a: Array, b: Array) -> Array:
    """Smallest rotation [..., 3, 3] that turns unit vectors a into b (not opposite)."""
    cross = np.cross(a, b)
    k = np.zeros((*cross.shape[:-1], 3, 3))
    k[..., 0, 1], k[..., 0, 2], k[..., 1, 2] = -cross[..., 2], cross[..., 1], -cross[..., 0]
    k = k - np.swapaxes(k, -1, -2)
    dot = (a * b).sum(-1)[..., None, None]
    return np.eye(3) + k + k @ k / (1 + dot)


def floor_height(places: Array) -> float:
    """Height of the standing ball joints of one clip [N, 22, 3]."""
    return float(np.median(standing_balls(places)[:, 2]))


@dataclass(frozen=True)
class ContactLimits:
    """A joint touches when it is low and slow.

    Low: below `height` above its lowest place within `window` seconds, which a step or a foot
    measured a little too high moves along; that place must itself be within `ground` of the
    floor. Slow: below `speed` plus `speed_share` of the hips' speed (runners' feet never rest).
    """

    ball_height: float = 0.03
    ankle_height: float = 0.025
    window: float = 0.4
    ground: float = 0.06
    speed: float = 0.4
    speed_share: float = 0.1


def ankle_height(places: Array) -> float | None:
    """Height of the ankles above the ball plane while the foot stands flat; None if it never does.

    places [N, 22, 3] on a floor at z = 0.
    """
    balls, ankles = places[:, BALLS], places[:, ANKLES]
    flat = (speeds(balls) < STILL) & (speeds(ankles) < STILL) & (np.abs(balls[..., 2]) < 0.03)
    heights = ankles[..., 2][flat]
    if len(heights) < 5:
        return None
    low = heights[heights < np.percentile(heights, 20) + 0.03]
    return float(np.median(low))


def find_contacts(places: Array, ankle: float, limits: ContactLimits = ContactLimits()) -> Array:
    """Contacts [N, 2, 2] bool: left, right foot × heel, ball. places [N, 22, 3], floor at z = 0.

    `ankle` is the ankles' height above the ball plane when the foot stands flat.
    Gaps and touches of a single frame are taken as noise.
    """
    hips = speeds(places[:, :1])
    parts = []
    for joints, level, height in (
        (ANKLES, ankle, limits.ankle_height),
        (BALLS, 0.0, limits.ball_height),
    ):
        points = places[:, joints]
        lowest = minimum_filter1d(points[..., 2], 2 * round(limits.window * FPS) + 1, axis=0)
        near = np.abs(lowest - level) < limits.ground
        base = np.where(near, lowest, level)
        slow = speeds(points) < limits.speed + limits.speed_share * hips
        parts.append((points[..., 2] < base + height) & slow)
    return _median3(np.stack(parts, -1))


def _median3(flags: Array) -> Array:
    if len(flags) < 3:
        return flags
    middle = flags[:-2].astype(int) + flags[1:-1] + flags[2:] >= 2
    return np.concatenate([middle[:1], middle, middle[-1:]])
