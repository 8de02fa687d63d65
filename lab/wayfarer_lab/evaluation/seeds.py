"""Walking seeds: two frames of recorded walking on another body, from which an agent starts."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from wayfarer.errors import InvalidArgument
from wayfarer.spec import FPS, SEED_FRAMES
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.slots import Gait, Mode, Motion, Seeds
from wayfarer_lab.evaluation.metrics.kinematics import WALKING_SPEED
from wayfarer_lab.evaluation.tracks import Recorded, skin_track
from wayfarer_lab.training.mocap.selection import Use

REACH: Final = FPS // 4
"""Frames on either side of a seed over which its speed is measured."""


def walking_seeds(
    recorded: Recorded, specs: Sequence[AgentSpec], random: np.random.Generator
) -> list[Motion]:
    """A random moment of recorded walking (0.9 … 1.4 m/s) for each agent, at its position.

    The pose is the recorded one, the shape the agent's; it is lifted or lowered so that its
    lowest sole marker is as high as that of the recorded body.
    """
    moments = _moments(recorded)
    if not len(moments):
        raise InvalidArgument("the recorded clips hold no walking at 0.9 … 1.4 m/s")
    return [_seed(recorded, spec, int(random.choice(moments))) for spec in specs]


def _moments(recorded: Recorded) -> np.ndarray:
    """Frames of the data set at which a seed may begin."""
    found = []
    low, high = WALKING_SPEED
    for clip in recorded.clips:
        for run in recorded.used(clip, Use.LOCOMOTION):
            frames = np.arange(clip.start + run.start + REACH, clip.start + run.stop - REACH)
            hips = recorded.data.translation[:, :2]
            way = np.linalg.norm(hips[frames + REACH] - hips[frames - REACH], axis=-1)
            speed = way * FPS / (2 * REACH)
            found.append(frames[(speed >= low) & (speed <= high)])
    return np.concatenate(found) if found else np.zeros(0, np.int64)


def _seed(recorded: Recorded, spec: AgentSpec, start: int) -> Motion:
    data = recorded.data
    clip = data.clips[data.clip_of_frame[start]]
    frames = slice(start, start + SEED_FRAMES)
    hips, rotations = data.translation[frames].astype(np.float64), data.rotations[frames]
    before = skin_track(recorded.bodies[clip.gender], np.array(clip.betas), hips, rotations)
    body = recorded.bodies[spec.gender]
    after = skin_track(body, np.array(spec.betas), hips, rotations)
    soles = body.sole_markers
    lift = before.markers[:, soles, 2].min() - after.markers[:, soles, 2].min()
    move = np.array([*(np.array(spec.position) - hips[-1, :2]), lift])

    seed, gait = Seeds.empty(1), Gait.empty(1)
    seed.markers[0] = after.markers + move
    seed.translation[0] = hips + move
    seed.rotations[0] = rotations
    gait.mode[0] = Mode.WALKING
    gait.speed[0] = np.linalg.norm(hips[1, :2] - hips[0, :2]) * FPS
    return Motion(seed, gait)
