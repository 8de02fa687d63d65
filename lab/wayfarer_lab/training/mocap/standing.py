"""Natural standing: how far knees bend in it, and the poses in which agents are created."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.rig import J
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.skeleton import Array
from wayfarer_lab.training.mocap.store import Dataset, atomically, mirror

CROUCHED = np.deg2rad(20.0)
"""Mean bend of the knees beyond which a standing person is ready to run, or acts. Recorded stands
of three seconds have 4 to 15 degrees.
"""

STRAIGHT = np.deg2rad(14.0)
"""The most in a start pose."""

EVERY = 2 * FPS  # frames of a quiet stretch of which the calmest may become a pose
MAX_POSES = 24  # before mirroring
PER_SUBJECT = 8
MAX_UNNATURAL = 36.0  # degrees, see `_unnatural`
MIN_DIFFERENCE = np.deg2rad(4.0)  # root mean square over joints
TRUNK = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")


@dataclass(frozen=True)
class StandingPose:
    """A recorded pose: local quaternions [22, 4], heading 0, and its clip."""

    rotations: Array
    source: str
    subject: str


def knee_bend(rotations: NDArray[np.floating]) -> NDArray[np.floating]:
    """Mean angle of both knees [N] in radians; local rotations [N, 22, 4]."""
    knees = rotations[:, [J["left_knee"], J["right_knee"]]]
    bend = 2 * np.arctan2(np.linalg.norm(knees[..., :3], axis=-1), np.abs(knees[..., 3]))
    return np.asarray(bend.mean(-1))


def standing_poses(data: Dataset) -> list[StandingPose]:
    """Up to `MAX_POSES` differing poses out of quiet train frames, then their mirror images."""
    found: list[tuple[float, StandingPose]] = []
    seen: dict[str, str] = {}  # the same clip on another gender's body adds nothing
    for clip in data.clips:
        if clip.split != "train" or clip.shape != "own" or clip.acted or clip.augmentation:
            continue
        if seen.setdefault(clip.source, clip.gender) != clip.gender:
            continue
        rows = slice(clip.start, clip.stop)
        rotations = data.rotations[rows].astype(np.float64)
        quiet = (data.use[rows] == Use.STANDING) & (knee_bend(rotations) < STRAIGHT)
        change = np.linalg.norm(np.diff(rotations, axis=0, prepend=rotations[:1]), axis=-1).mean(-1)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], quiet, [False]]).astype(int)))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            for start in range(a, b, EVERY):
                calmest = start + change[start : min(start + EVERY, b)].argmin()
                turned = _facing_forward(rotations[calmest])
                unnatural = _unnatural(matrix_from_quaternion(turned))
                found.append((unnatural, StandingPose(turned, clip.source, clip.subject)))
    found.sort(key=lambda item: item[0])
    kept: list[StandingPose] = []
    for unnatural, pose in found:
        same = sum(k.subject == pose.subject for k in kept)
        room = same < PER_SUBJECT and len(kept) < MAX_POSES
        new = all(_difference(k, pose) > MIN_DIFFERENCE for k in kept)
        if unnatural < MAX_UNNATURAL and room and new:
            kept.append(pose)
    return kept + [_mirrored(p) for p in kept]


def _facing_forward(rotations: Array) -> Array:
    turned = rotations.copy()
    hips = Rotation.from_quat(rotations[0])
    forward = hips.as_matrix()[:2, 1]
    back = Rotation.from_euler("z", -np.arctan2(-forward[0], forward[1]))
    turned[0] = (back * hips).as_quat()
    return turned


def _angles(local: Array) -> Array:
    trace = np.trace(local, axis1=-2, axis2=-1)
    return np.rad2deg(np.arccos(np.clip((trace - 1) / 2, -1, 1)))


def _unnatural(local: Array) -> float:
    """Maximum of hips' lean, spine's twist, head's tilt, elbows' bend and arms off the body, in
    weighted degrees.
    """
    lean = np.rad2deg(np.arccos(np.clip(local[0, 2, 2], -1, 1)))
    angles = _angles(local)
    spine = angles[[J["spine1"], J["spine2"], J["spine3"]]].sum()
    head = np.linalg.multi_dot([local[J[n]] for n in TRUNK])
    elbows = angles[[J["left_elbow"], J["right_elbow"]]].max()
    away = 2 * _arms_away(local)
    return float(max(2 * lean, 1.5 * spine, _angles(head), 0.8 * elbows, away))


def _arms_away(local: Array) -> float:
    """Degrees by which the farther upper arm is off the chest's median plane; 0: straight down."""
    ways = [
        (local[J[f"{side}_collar"]] @ local[J[f"{side}_shoulder"]])[0, 0]
        for side in ("left", "right")
    ]
    return float(np.rad2deg(np.arcsin(np.clip(max(ways), -1, 1))))


def _difference(a: StandingPose, b: StandingPose) -> float:
    between = Rotation.from_quat(a.rotations).inv() * Rotation.from_quat(b.rotations)
    return float(np.sqrt((between.magnitude() ** 2).mean()))


def _mirrored(pose: StandingPose) -> StandingPose:
    _, turned, _ = mirror(np.zeros(3), pose.rotations, np.zeros(2, bool))
    return replace(pose, rotations=turned)


def save_start_poses(folder: Path, poses: list[StandingPose]) -> None:
    """Writes `start_poses.npz`: rotations [P, 22, 4] (x, y, z, w, heading 0) and sources [P]."""
    rotations = np.array([p.rotations for p in poses]).reshape(-1, 22, 4)
    atomically(
        folder / "start_poses.npz",
        lambda path: np.savez(
            path,
            rotations=rotations.astype(np.float32),
            sources=np.array([p.source for p in poses], dtype=str),
        ),
    )
