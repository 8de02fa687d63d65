"""Copying a motion's rotations to a body: the initial guess of the fit, and its targets.

Limb rotations are re-aligned so that bones point where the recorded ones do (smallest
rotations, down the chain). Torso and head rotations are copied as they are: spine joints sit
at different depths in different skeletons, so their directions do not compare.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from wayfarer.body.model import BodyModel
from wayfarer.spec import POSED_JOINTS
from wayfarer_lab.training.mocap.floor import ANKLES, BALLS, rotation_between
from wayfarer_lab.training.mocap.repair import despike
from wayfarer_lab.training.mocap.resample import nearest_rotations
from wayfarer_lab.training.mocap.rig import PARENTS, ClipInfo, J, SourceClip
from wayfarer_lab.training.mocap.selection import classify
from wayfarer_lab.training.mocap.shape import RetargetShape
from wayfarer_lab.training.mocap.skeleton import Array

LIMBS = [
    [J[f"{side}_{part}"] for part in chain]
    for side in ("left", "right")
    for chain in (("hip", "knee", "ankle", "foot"), ("shoulder", "elbow", "wrist"))
]
STRAIGHT_KNEE = np.deg2rad(5)  # flexion of a straight leg in walking
MAX_KNEE_BIAS = np.deg2rad(15)  # optical knee centres make knees look bent by up to this
HIPS = [J["left_hip"], J["right_hip"]]
LEGS = [chain for chain in LIMBS if len(chain) == 4]
WRISTS = [J["left_wrist"], J["right_wrist"]]
SHOULDERS = [J["left_shoulder"], J["right_shoulder"]]
ARMS = [
    (J[f"{side}_{a}"], J[f"{side}_{b}"])
    for side in ("left", "right")
    for a, b in (("shoulder", "elbow"), ("elbow", "wrist"))
]


@dataclass(frozen=True)
class Subject:
    """Measures taken once per recorded person."""

    ankle_height: float  # of a flat foot, above the ball plane, metres
    straight_knee: float  # flexion that the recording shows when the leg is straightest, radians
    sole: Array  # [2, 3] mean up vector of the flat left, right foot, in the file's foot frame


@dataclass(frozen=True)
class FitProblem:
    """A clip to be fitted to a shape: first guess, targets, contacts. World frame, floor z = 0."""

    info: ClipInfo
    shape: RetargetShape
    translation: Array  # [N, 3] initial
    local: Array  # [N, 22, 3, 3] initial
    targets: Array  # [N, 22, 3]
    touch: Array  # [N, 2, 2] bool: left, right foot × heel, ball
    use: Array  # [N] uint8, selection.Use

    def __len__(self) -> int:
        return len(self.translation)


def flat_feet(clip: SourceClip) -> Array:
    """Frames [N, 2] in which the foot stands flat: heel and ball both touch."""
    return np.asarray(clip.contacts.all(-1))


def mean_sole(clips: list[SourceClip]) -> Array:
    """World up [2, 3] seen from the flat foot's frame: shows how soles are mounted in the file."""
    soles = []
    for foot, ankle in enumerate(ANKLES):
        ups = [c.rotations[flat_feet(c)[:, foot], ankle, 2, :] for c in clips]
        seen = np.concatenate(ups)
        up = np.median(seen, axis=0) if len(seen) >= 10 else np.array([0.0, 0.0, 1.0])
        soles.append(up / np.linalg.norm(up))
    return np.array(soles)


def alignment(rest_source: Array, rest_body: Array, sole: Array) -> Array:
    """Rotations [22, 3, 3]: body joint rotation = recorded rotation · alignment."""
    turns = np.broadcast_to(np.eye(3), (POSED_JOINTS, 3, 3)).copy()
    for chain in LIMBS:
        turn = np.eye(3)
        for joint, below in itertools.pairwise(chain):
            wanted = rest_source[below] - rest_source[joint]
            own = turn @ (rest_body[below] - rest_body[joint])
            turn = (
                rotation_between(own / np.linalg.norm(own), wanted / np.linalg.norm(wanted)) @ turn
            )
            turns[joint] = turn
        turns[chain[-1]] = turn
    for foot, (ankle, ball) in enumerate(zip(ANKLES, BALLS, strict=True)):
        # a flat recorded foot must give a flat body foot: pitch and roll, keeping the yaw
        up = turns[ankle].T @ sole[foot]
        turns[ankle] = turns[ankle] @ rotation_between(np.array([0.0, 0.0, 1.0]), up)
        turns[ball] = turns[ankle]
    return turns


def leg_chord(rest: Array, flexion: float) -> float:
    """Mean distance from hip to ankle at this knee flexion (radians), from rest places [22, 3]."""
    chords = []
    for hip, knee, ankle, _ in LEGS:
        a, b = np.linalg.norm(rest[knee] - rest[hip]), np.linalg.norm(rest[ankle] - rest[knee])
        chords.append(np.sqrt(a * a + b * b + 2 * a * b * np.cos(flexion)))
    return float(np.mean(chords))


def straightest_knee(clips: list[SourceClip]) -> float:
    """Knee flexion in radians that 2 % of a subject's frames do not reach."""
    flexions = []
    for hip, knee, ankle, _ in LEGS:
        for clip in clips:
            thigh = clip.places[:, knee] - clip.places[:, hip]
            shin = clip.places[:, ankle] - clip.places[:, knee]
            lengths = np.linalg.norm(thigh, axis=-1) * np.linalg.norm(shin, axis=-1)
            flexions.append(np.arccos(np.clip((thigh * shin).sum(-1) / lengths, -1, 1)))
    return float(np.percentile(np.concatenate(flexions), 2))


def bend_knee(hip: Array, ankle: Array, hint: Array, thigh: float, shin: float) -> Array:
    """Knee places [N, 3] that fit both bones, bent towards `hint`; straight if out of reach."""
    line = ankle - hip
    distance = np.linalg.norm(line, axis=-1, keepdims=True)
    line = line / distance
    reach = np.clip(distance, abs(thigh - shin) + 1e-6, (thigh + shin) * 0.9999)
    along = (reach**2 + thigh**2 - shin**2) / (2 * reach)
    side = (hint - hip) - ((hint - hip) * line).sum(-1, keepdims=True) * line
    side = side / np.maximum(np.linalg.norm(side, axis=-1, keepdims=True), 1e-9)
    across = np.sqrt(np.maximum(thigh**2 - along**2, 0.0))
    return hip + (along * distance / reach) * line + across * side


def make_problem(
    clip: SourceClip, subject: Subject, body: BodyModel, shape: RetargetShape
) -> FitProblem:
    """Scale a clip to the legs of a shape and copy its rotations."""
    every = body.rest_joints(shape.betas)
    rest = every[:POSED_JOINTS]
    extra = np.clip(subject.straight_knee - STRAIGHT_KNEE, 0, MAX_KNEE_BIAS)
    scale = leg_chord(rest, STRAIGHT_KNEE) / leg_chord(clip.rest, STRAIGHT_KNEE + extra)
    turns = alignment(clip.rest, rest, subject.sole)
    world = clip.rotations @ turns
    world[:, BALLS] = world[:, ANKLES]  # toes are noise in optical data; the fit bends them
    local = world.copy()
    local[:, 1:] = np.swapaxes(world[:, PARENTS[1:]], -1, -2) @ world[:, 1:]
    for joint in ANKLES + WRISTS:
        local[:, joint] = despike(local[:, joint])
    local[:, WRISTS] = nearest_rotations(gaussian_filter1d(local[:, WRISTS], 1.5, axis=0))

    targets = clip.places * scale
    targets[..., 2] += rest[ANKLES, 2].mean() - scale * subject.ankle_height
    middle = targets[:, HIPS].mean(1)
    targets[:, HIPS] = middle[:, None] + (rest[HIPS] - rest[HIPS].mean(0)) @ np.swapaxes(
        world[:, 0], -1, -2
    )
    for hip, knee, ankle, _ in LEGS:
        thigh, shin = (np.linalg.norm(rest[i] - rest[k]) for i, k in ((hip, knee), (knee, ankle)))
        targets[:, knee] = bend_knee(
            targets[:, hip], targets[:, ankle], targets[:, knee], float(thigh), float(shin)
        )
    translation = middle - world[:, 0] @ (rest[HIPS].mean(0) - rest[0])
    _, copied = body.forward_kinematics(translation, local, every)
    # Feet and arms differ in length and arms in where they begin: keep their directions instead.
    for above, below in (*zip(ANKLES, BALLS, strict=True), *ARMS):
        if above in ANKLES:
            targets[:, below] = targets[:, above] + copied[:, below] - copied[:, above]
        else:
            bone = clip.places[:, below] - clip.places[:, above]
            length = np.linalg.norm(rest[below] - rest[above])
            start = targets[:, above] if above not in SHOULDERS else copied[:, above]
            targets[:, above] = start
            targets[:, below] = start + length * bone / np.linalg.norm(bone, axis=-1, keepdims=True)
    return FitProblem(clip.info, shape, translation, local, targets, clip.contacts, classify(clip))
