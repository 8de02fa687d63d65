"""Poses of the shipped body for the tests of legs, two-bone kinematics and foot lock."""

from functools import cache

import numpy as np

from wayfarer.body.library import load_body
from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import quaternion_from_rotvec
from wayfarer.spec import BETAS, FPS, POSED_JOINTS
from wayfarer.world.output.legs import ANKLES, HIPS, KNEES, Legs, measure_legs, pose_legs

JOINTS = (HIPS, KNEES, ANKLES)
KNEE_BEND = 0.6  # radians


@cache
def body() -> BodyModel:
    return load_body("anny52", "female", "low")


def legs(agents: int = 1, betas: np.ndarray | None = None) -> Legs:
    row = measure_legs(body(), np.zeros(BETAS) if betas is None else betas)
    return row.take(np.zeros(agents, np.int64))


def standing(frames: int, bend: float = KNEE_BEND) -> tuple[np.ndarray, np.ndarray]:
    """One agent, soles flat on the floor, both knees bent: [1, F, 3], [1, F, 22, 4]."""
    rotations = np.zeros((1, frames, POSED_JOINTS, 4), np.float32)
    rotations[..., 3] = 1
    for joints, angle in zip(JOINTS, (bend / 2, -bend, bend / 2), strict=True):
        rotations[:, :, joints] = quaternion_from_rotvec(np.array([angle, 0.0, 0.0]))
    translation = np.zeros((1, frames, 3), np.float32)
    translation[..., 2] = -soles_of(translation, rotations)[..., 2].min()
    return translation, rotations


def lifted(rotations: np.ndarray, foot: int, angle: np.ndarray) -> np.ndarray:
    """A raised leg: its hip bent by `angle` [F] radians, its knee by twice that, the foot level."""
    drawn = rotations.copy()
    for joints, times in zip(JOINTS, (1, -2, 1), strict=True):
        turns = np.zeros((len(angle), 3))
        turns[:, 0] = times * (KNEE_BEND / 2 + angle)
        drawn[:, :, joints[foot]] = quaternion_from_rotvec(turns)
    return drawn


def moved(translation: np.ndarray, velocity: tuple[float, float, float]) -> np.ndarray:
    """The whole body gliding, metres per second."""
    seconds = np.arange(translation.shape[1])[:, None] / FPS
    return (translation + seconds * np.array(velocity)).astype(np.float32)


def soles_of(
    translation: np.ndarray, rotations: np.ndarray, betas: np.ndarray | None = None
) -> np.ndarray:
    """Sole points [A, F, 2, P, 3] in the world, of the mean shape or `betas` [10]."""
    shape = legs(len(translation), betas)
    return pose_legs(shape, translation, rotations).soles
