"""Widen the locomotion of the train split: what the recordings lack, made from what they have.

Every result is a new `FitProblem`: it is fitted again with its foot contacts kept, and carries
its kind in `augmentation`. Validation and heldout stay as recorded.
"""

import zlib
from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from wayfarer.body.model import BodyModel
from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.curve import curve
from wayfarer_lab.training.mocap.fit import FittedClip
from wayfarer_lab.training.mocap.posed import PosedMotion, at_times, hips_speed, pose
from wayfarer_lab.training.mocap.retarget import FitProblem
from wayfarer_lab.training.mocap.shape import random_shape
from wayfarer_lab.training.mocap.standing import StandingPose, stand
from wayfarer_lab.training.mocap.startstop import AFTER, mid_stances, start, stop
from wayfarer_lab.training.mocap.stepturn import step_turn

WARP = (0.8, 1.25)  # range of speed factors
CURVE = (0.3, 1.2)  # rad/s
STRAIGHT = np.deg2rad(25)  # a walk that turns less than this may be bent
WALKING = (0.3, 2.0)  # m/s, mean over the clip
STAND_SECONDS = 3.0
STEP_TURNS = (60, 90, 135, 180)  # degrees


def augment(
    fits: list[FittedClip],
    poses: list[StandingPose],
    bodies: dict[str, BodyModel],
    seed: int = 0,
) -> list[FitProblem]:
    """All augmentations of the train split's walking clips, and standing for every pose."""
    made: list[PosedMotion] = []
    for clip in _one_shape_each(fits, seed):
        generator = _generator(seed, clip.info.name, clip.shape.gender)
        made += _walks(pose(clip, bodies[clip.shape.gender]), poses, bodies, generator)
    generator = np.random.default_rng([seed, 1])
    for body in bodies.values():
        made += _standing(poses, body, generator)
    return [m.problem() for m in made]


def _generator(seed: int, *key: str) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32("|".join(key).encode())])


def _one_shape_each(fits: list[FittedClip], seed: int) -> list[FittedClip]:
    """Train locomotion, for each clip and gender one of its shapes, drawn at random."""
    groups: dict[tuple[str, str], list[FittedClip]] = defaultdict(list)
    for clip in fits:
        if clip.info.split == "train" and clip.info.locomotion:
            groups[clip.info.name, clip.shape.gender].append(clip)
    return [
        clips[_generator(seed, "shape", *key).integers(len(clips))] for key, clips in groups.items()
    ]


def _walks(
    motion: PosedMotion,
    poses: list[StandingPose],
    bodies: dict[str, BodyModel],
    generator: np.random.Generator,
) -> Iterator[PosedMotion]:
    speed = float(hips_speed(motion).mean())
    if not WALKING[0] < speed < WALKING[1]:
        return
    if generator.random() < 0.5:
        factor = float(np.exp(generator.uniform(*np.log(WARP))))
        warped = at_times(motion, np.arange(0, len(motion) - 1, factor))
        yield warped.tagged("warp", f"warp{factor:.2f}")

    def bent(walk: PosedMotion, begin: float) -> PosedMotion:
        return curve(walk, generator.choice([-1, 1]) * generator.uniform(*CURVE), begin)

    straight = np.ptp(motion.heading()) < STRAIGHT
    if straight and len(motion) >= FPS:
        yield bent(motion, generator.uniform(0, 0.5))
    if not poses:
        return
    body = bodies[motion.shape.gender]
    passing = mid_stances(motion)
    starts = [(k, foot) for k, foot in passing if k + AFTER < len(motion)]
    stops = [(k, foot) for k, foot in passing if k > AFTER]
    for options, make in ((starts, start), (stops, stop)):
        if options:
            frame, foot = options[generator.integers(len(options))]
            stance = poses[generator.integers(len(poses))]
            made = make(motion, frame, foot, stance, body, generator)
            turn = straight and make is start and generator.random() < 0.5
            yield bent(made, 0.5) if turn else made


def _standing(
    poses: list[StandingPose], body: BodyModel, generator: np.random.Generator
) -> Iterator[PosedMotion]:
    for stance in poses:
        standing = stand(stance, random_shape(body, generator), body, STAND_SECONDS, generator)
        yield standing
        degrees = generator.choice(STEP_TURNS) * generator.choice([-1, 1])
        shape = random_shape(body, generator)
        yield step_turn(stance, shape, body, float(np.deg2rad(degrees)), generator)
