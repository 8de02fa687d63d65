"""Coasting: agents that are seen at most as a root continue without the model.

Nobody sees their poses, so when time is short they cost no engine call. The hips go straight to
steering's aim, at its speed, and the body turns to the requested facing. Only the thighs swing, for
the phase of the gait that a root has (`runtime/streams/root_tracks.py`). The seed is moved along as
a rigid body, so an agent that comes nearer is in mid-stride, and the model continues from there.

World space, metres. Pure functions of columns: rows do not influence each other.
"""

from math import pi
from typing import Final

import numpy as np

from wayfarer.body.skeleton import joint_names
from wayfarer.spec import FPS, NEW_FRAMES, STEP_SECONDS
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.heading import facing_of
from wayfarer.world.agents.slots import Gait, Seeds
from wayfarer.world.goals.gait_rules import Targets
from wayfarer.world.output.quaternion import bounded, multiply
from wayfarer.world.rows import Double, Flags, Float, Index

TURN: Final = pi * STEP_SECONDS
"""Maximum radians that a body turns in a step."""

CADENCE: Final = (0.57, 0.27)
"""Stride frequency (1/s): intercept at rest, slope per m/s."""

LEG: Final = 0.85
"""Metres from hip to ankle, for the swing of a thigh."""

BEARS: Final = 0.6
"""Share of a stride during which a foot is on the floor."""

HIPS: Final = [joint_names().index(f"{side}_hip") for side in ("left", "right")]

_RISE: Final = np.arange(1, NEW_FRAMES + 1, dtype=np.float32) / NEW_FRAMES


def coast(
    seed: Seeds, gait: Gait, targets: Targets, goals: GoalColumns, chunks: Index
) -> tuple[Float, Float, Flags, Seeds]:
    """The next step of agents: translation [A, F, 3], rotations [A, F, 22, 4], contacts [A, F, 2]
    (left, right), and the seed of the step after it.

    `gait`, `targets` and `goals` are the step's, `chunks` [A] the numbers of its chunks.
    """
    hips = seed.translation[:, -1]
    way = targets.place - hips[:, :2]
    distance = np.linalg.norm(way, axis=-1)
    speed = targets.speed / (1 + gait.trim)  # the request compensates for the model's errors
    metres = np.minimum(_evenly(gait.speed[:, None], speed[:, None])[..., 0], distance[:, None])
    translation = np.repeat(hips[:, None], NEW_FRAMES, axis=1)
    translation[..., :2] += metres[..., None] * (way / np.maximum(distance, 1e-6)[:, None])[:, None]

    asked = np.where(targets.facing.any(-1, keepdims=True), targets.facing, way)
    angle = _turn(facing_of(seed.rotations[:, -1, 0]), asked)
    rotations = np.repeat(seed.rotations[:, -1:], NEW_FRAMES, axis=1)
    rotations[:, :, 0] = _yawed(rotations[:, :, 0], (_RISE * angle[:, None]).astype(np.float32))
    gone = np.linalg.norm(translation[:, -1] - hips, axis=-1)
    phase, swing = _stride((gone / STEP_SECONDS).astype(np.float32), goals.speed, chunks)
    for joint, half in zip(HIPS, (phase, phase + 0.5), strict=True):
        thigh = swing[:, None] * np.cos(2 * pi * half) / 2
        rotations[:, :, joint] = 0
        rotations[:, :, joint, 0], rotations[:, :, joint, 3] = np.sin(thigh), np.cos(thigh)
    bears = np.stack([phase % 1 < BEARS, (phase + 0.5) % 1 < BEARS], -1)
    bears |= swing[:, None, None] == 0
    return translation, rotations, bears, _moved(seed, angle, translation[:, -1] - hips)


def _evenly(before: Float, after: Float) -> Float:
    """Way [A, F, D] of a body whose velocity goes from `before` to `after` [A, D], m/s."""
    rise = _RISE[:, None]
    way = STEP_SECONDS * rise * (before[:, None] + rise / 2 * (after - before)[:, None])
    return np.asarray(way, np.float32)


def _turn(facing: Float, way: Float) -> Float:
    """Radians [A] by which bodies that face [A, 2] turn towards another way [A, 2] in the step."""
    crossed = facing[:, 0] * way[:, 1] - facing[:, 1] * way[:, 0]
    angle: Float = bounded(np.arctan2(crossed, (facing * way).sum(-1)), -TURN, TURN)
    return angle.astype(np.float32)


def _stride(speed: Float, usual: Float, chunks: Index) -> tuple[Double, Float]:
    """The phase of each frame [A, F], 0 as the left foot strikes, and the swing of a thigh to each
    side [A], radians, of agents at `speed` [A] whose usual speed is `usual` [A], m/s.

    The phase follows from the number of the chunk, so nothing is remembered.
    """
    cadence = CADENCE[0] + CADENCE[1] * usual
    frames = NEW_FRAMES * chunks[:, None] + np.arange(NEW_FRAMES)
    step = speed / (2 * cadence)
    swing = np.arcsin(bounded(step / (2 * LEG), 0, 1))
    phase: Double = cadence[:, None].astype(np.float64) * frames / FPS
    return phase, swing.astype(np.float32)


def _moved(seed: Seeds, angle: Float, way: Float) -> Seeds:
    """Seeds turned by `angle` [A], radians, about the vertical through the hips, and moved by `way`
    [A, 3].
    """
    centre, cos, sin = seed.translation[:, -1], np.cos(angle), np.sin(angle)

    def moved(points: Float) -> Float:
        each = slice(None), *(None,) * (points.ndim - 2)  # one for all points of an agent
        x, y = (points[..., axis] - centre[:, axis][each] for axis in (0, 1))
        found = points.copy()
        found[..., 0] = cos[each] * x - sin[each] * y + (centre + way)[:, 0][each]
        found[..., 1] = sin[each] * x + cos[each] * y + (centre + way)[:, 1][each]
        return found

    rotations = seed.rotations.copy()
    rotations[:, :, 0] = _yawed(rotations[:, :, 0], angle[:, None])
    return Seeds(moved(seed.markers), moved(seed.translation), rotations)


def _yawed(rotations: Float, angle: Float) -> Float:
    """Rotations [A, F, 4] turned by radians `angle` [A, F or 1] about the vertical."""
    turn = np.zeros((4, *angle.shape), np.float32)
    turn[2], turn[3] = np.sin(angle / 2), np.cos(angle / 2)
    return np.moveaxis(multiply(turn, np.moveaxis(rotations, -1, 0)), 0, -1)
