"""Takes of a real body whose pose is written down frame by frame."""

import numpy as np

from wayfarer.body.library import load_body
from wayfarer.body.rotation import quaternion_from_rotvec
from wayfarer.clips.clip import Clip
from wayfarer.spec import BETAS, FPS, POSED_JOINTS
from wayfarer.world.agents.goal import Goal
from wayfarer.world.output.quaternion import multiply
from wayfarer_lab.evaluation.maneuvers.maneuver import MeasuredTake
from wayfarer_lab.evaluation.takes import JOINT, Take

BODY = load_body("anny52", "female", "low")
HEIGHT = float(BODY.rest_joints(np.zeros(BETAS))[0, 2])
"""Height of the hips in the T-pose."""


def time(seconds: float) -> np.ndarray:
    """Times of the frames [T]."""
    return np.arange(round(seconds * FPS)) / FPS


def take(
    seconds: float,
    x: np.ndarray | float = 0.0,
    y: np.ndarray | float = 0.0,
    up: np.ndarray | float = 0.0,
    heading: np.ndarray | float = 0.0,
    told: np.ndarray | bool = True,
    name: str = "built",
    person: str = "",
    **joints: tuple[float | np.ndarray, float | np.ndarray, float | np.ndarray],
) -> Take:
    """A T-pose at places x, y (m), raised by `up` (m), turned to `heading` (degrees, left), whose
    `joints` are turned about the axes right, forward, up (degrees); `pelvis` turns all of it.
    """
    frames = round(seconds * FPS)
    hips = np.stack(
        [np.broadcast_to(np.asarray(v, float), frames) for v in (x, y, HEIGHT + np.asarray(up))], -1
    )
    turns = np.zeros((frames, POSED_JOINTS, 3))
    for joint, degrees in joints.items():
        for axis, value in enumerate(degrees):
            turns[:, JOINT[joint], axis] = np.radians(value)
    rotations = quaternion_from_rotvec(turns)
    yaw = np.zeros((frames, 3))
    yaw[:, 2] = np.radians(heading)
    rotations[:, 0] = multiply(quaternion_from_rotvec(yaw).T, rotations[:, 0].T).T
    contacts = np.broadcast_to(np.asarray(told), (frames, 2))
    clip = Clip(hips, rotations, contacts, "female", (0.0,) * BETAS)
    return Take.of(clip, BODY, name, person)


def shot(
    made: Take, goal: tuple[float, float] | None = None, heading: float | None = None
) -> MeasuredTake:
    """A take with the goal (m) that was given; `heading` in degrees."""
    if goal is None:
        return MeasuredTake(made)
    facing = None if heading is None else float(np.radians(heading))
    return MeasuredTake(made, Goal((*goal, 0.0), heading=facing))


def walker(seconds: float = 8.0, bob: float = 0.03, **joints: tuple[float, float, float]) -> Take:
    """1.2 m/s, 120 steps a minute; hips swing by ±28°, knees bend up to 60° behind."""
    t = time(seconds)
    swing = 28 * np.cos(2 * np.pi * t)
    knees = 30 - 30 * np.cos(2 * np.pi * (t - 0.1))
    return take(
        seconds,
        y=1.2 * t,
        up=bob / 2 * np.cos(4 * np.pi * t) - 0.05,
        left_hip=(swing, 0, 0),
        right_hip=(-swing, 0, 0),
        left_knee=(-knees, 0, 0),
        right_knee=(-np.roll(knees, FPS // 2), 0, 0),
        **joints,
    )
