"""Natural standing poses out of recordings: what agents stand in when they are created."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer_lab.training.mocap.fit import FittedClip, matrix_quaternions
from wayfarer_lab.training.mocap.resample import nearest_rotations
from wayfarer_lab.training.mocap.rig import J
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.skeleton import Array
from wayfarer_lab.training.mocap.store import atomically, mirror

MAX_POSES = 16  # before mirroring
PER_SUBJECT = 5
MAX_UNNATURAL = 36.0  # degrees, see `_unnatural`
MAX_KNEE = np.deg2rad(8)
MAX_LEAN = np.deg2rad(3)
MIN_DIFFERENCE = np.deg2rad(4.0)  # root mean square over joints
AVERAGED = 5  # frames that make one pose: takes away marker noise


@dataclass(frozen=True)
class StandingPose:
    """A standing pose: local rotations [22, 3, 3], heading 0, and its clip."""

    local: Array
    source: str
    subject: str


def standing_poses(fits: list[FittedClip]) -> list[StandingPose]:
    """Up to `MAX_POSES` differing poses out of quiet train frames, then their mirror images."""
    found: list[tuple[float, StandingPose]] = []
    seen: dict[str, str] = {}  # the same clip on another gender's body adds nothing
    for clip in fits:
        if (
            clip.info.split != "train"
            or clip.shape.kind != "own"
            or seen.setdefault(clip.info.name, clip.shape.gender) != clip.shape.gender
        ):
            continue
        quiet = clip.use == Use.STANDING
        edges = np.flatnonzero(np.diff(np.concatenate([[False], quiet, [False]]).astype(int)))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            local = matrix_from_quaternion(clip.rotations[a:b].astype(np.float64))
            middle = _stillest(local)
            chosen = nearest_rotations(local[max(0, middle - 2) : middle + AVERAGED - 2].mean(0))
            chosen[0] = _facing_forward(chosen[0])
            pose = StandingPose(_straightened(chosen), clip.info.source, clip.info.subject)
            found.append((_unnatural(chosen), pose))
    found.sort(key=lambda item: item[0])
    kept: list[StandingPose] = []
    for badness, pose in found:
        same = sum(k.subject == pose.subject for k in kept)
        room = same < PER_SUBJECT and len(kept) < MAX_POSES
        new = all(_difference(k.local, pose.local) > MIN_DIFFERENCE for k in kept)
        if badness < MAX_UNNATURAL and room and new:
            kept.append(pose)
    return kept + [_mirrored(p) for p in kept]


def _stillest(local: Array) -> int:
    """Frame in the middle of the calmest stretch."""
    if len(local) < AVERAGED:
        return len(local) // 2
    change = np.linalg.norm(np.diff(local, axis=0), axis=(-1, -2)).mean(-1)
    calm = np.convolve(change, np.ones(AVERAGED - 1), "valid")
    return int(np.argmin(calm)) + AVERAGED // 2


def _facing_forward(hips: Array) -> Array:
    forward = hips[:2, 1]
    back = Rotation.from_euler("z", -np.arctan2(-forward[0], forward[1]))
    return back.as_matrix() @ hips


def _angles(local: Array) -> Array:
    trace = np.trace(local, axis1=-2, axis2=-1)
    return np.rad2deg(np.arccos(np.clip((trace - 1) / 2, -1, 1)))


def _unnatural(local: Array) -> float:
    """Maximum of hips' lean, knees' bend, spine's twist and head's tilt, in weighted degrees."""
    lean = _tilt(local[0])
    angles = _angles(local)
    knees = angles[[J["left_knee"], J["right_knee"]]].max()
    spine = angles[[J["spine1"], J["spine2"], J["spine3"]]].sum()
    head = np.linalg.multi_dot([local[J[n]] for n in TRUNK])
    elbows = angles[[J["left_elbow"], J["right_elbow"]]].max()
    return float(max(2 * lean, knees, 1.5 * spine, _angles(head), 0.8 * elbows))


TRUNK = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")


def _tilt(rotation: Array) -> float:
    return float(np.rad2deg(np.arccos(np.clip(rotation[2, 2], -1, 1))))


def _straightened(local: Array) -> Array:
    """Knees bent by at most `MAX_KNEE`, hips at most `MAX_LEAN` ahead of the ankles, feet flat.

    Recorded actors wait for their cue crouched forward; people who stand do not. Heading must
    be 0. Trunk, arms and feet keep their world rotations.
    """
    straight = local.copy()
    for side in ("left", "right"):
        hip, knee, ankle = (J[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
        foot = local[hip] @ local[knee] @ local[ankle]
        bend = Rotation.from_matrix(local[knee]).as_rotvec()
        angle = np.linalg.norm(bend)
        less = max(0.0, angle - MAX_KNEE) / max(angle, 1e-9)
        straight[hip] = local[hip] @ Rotation.from_rotvec(bend * less / 2).as_matrix()
        straight[knee] = Rotation.from_rotvec(bend * (1 - less)).as_matrix()
        thigh = local[0] @ straight[hip]
        chord = -(thigh[:, 2] + (thigh @ straight[knee])[:, 2])  # hip to ankle; bones alike
        lean = np.arctan2(-chord[1], -chord[2])
        back = Rotation.from_euler("x", max(0.0, lean - MAX_LEAN)).as_matrix()
        straight[hip] = local[0].T @ back @ thigh
        straight[ankle] = (straight[hip] @ straight[knee]).T @ foot
    return straight


def _difference(a: Array, b: Array) -> float:
    angles = _angles(np.swapaxes(a, -1, -2) @ b)
    return float(np.deg2rad(np.sqrt((angles**2).mean())))


def _mirrored(pose: StandingPose) -> StandingPose:
    quaternions = matrix_quaternions(pose.local)
    _, turned, _ = mirror(np.zeros(3), quaternions, np.zeros(2, bool))
    return replace(pose, local=matrix_from_quaternion(turned))


def save_start_poses(folder: Path, poses: list[StandingPose]) -> None:
    """Writes `start_poses.npz`: rotations [P, 22, 4] (x, y, z, w, heading 0) and sources [P]."""
    rotations = np.array([matrix_quaternions(p.local) for p in poses]).reshape(-1, 22, 4)
    atomically(
        folder / "start_poses.npz",
        lambda path: np.savez(
            path,
            rotations=rotations.astype(np.float32),
            sources=np.array([p.source for p in poses], dtype=str),
        ),
    )
