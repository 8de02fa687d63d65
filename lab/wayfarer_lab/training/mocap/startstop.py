"""Starting and stopping, made of a recorded walk and a recorded way of standing.

At mid-stance one foot carries the body and the other passes beside it: the instant of a walk
that is nearest to standing. A start stands with the carrying foot where it is at that instant,
shifts the weight over it, lifts the other foot, and lets the walk's time run from 0 to full
speed. A stop is the reverse in order (not the film backwards): the walk slows down towards a
mid-stance, and the passing foot is set down beside the other.
"""

from dataclasses import replace

import numpy as np

from wayfarer.body.model import BodyModel
from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.posed import (
    LEGS,
    PosedMotion,
    at_times,
    blend,
    hips_speed,
    join,
    smoothstep,
    stances,
)
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.skeleton import Array
from wayfarer_lab.training.mocap.standing import StandingPose, stand

RAMP = 0.8  # seconds in which a walk reaches its speed, or loses it
SHIFT = 0.3  # seconds of weight shift before the foot leaves the floor
SWING = 0.35  # seconds in which the lifted foot joins the walk, or leaves it to be set down
MIN_WALK, MAX_WALK = 0.4, 1.7  # m/s: walks to start and stop
AFTER = round(0.9 * FPS)  # frames of the walk that must follow (or precede) the mid-stance


def mid_stances(motion: PosedMotion) -> list[tuple[int, int]]:
    """(frame, carrying foot) where the other foot passes beside it, in steady walking."""
    found = []
    speed = hips_speed(motion)
    forward = motion.world[:, 0, :2, 1]
    forward = forward / np.linalg.norm(forward, axis=-1, keepdims=True)
    for foot in (0, 1):
        own, other = LEGS[foot][1], LEGS[1 - foot][1]
        ahead = ((motion.places[:, other, :2] - motion.places[:, own, :2]) * forward).sum(-1)
        for a, b in stances(motion.touch[:, foot]):
            passing = np.flatnonzero((ahead[a : b - 1] < 0) & (ahead[a + 1 : b] >= 0)) + a + 1
            found += [
                (int(k), foot)
                for k in passing
                if MIN_WALK < speed[k] < MAX_WALK
                and motion.touch[k, foot].all()
                and not motion.touch[k, 1 - foot].any()
            ]
    return sorted(found)


def start(
    motion: PosedMotion,
    frame: int,
    foot: int,
    pose: StandingPose,
    body: BodyModel,
    generator: np.random.Generator,
) -> PosedMotion:
    """Stand, then walk on from mid-stance `frame`, carried by `foot` (0 left, 1 right)."""
    still_for = generator.uniform(0.8, 1.6)
    ramp = round(RAMP * FPS)
    standing = _beside(
        stand(pose, motion.shape, body, still_for + RAMP, generator), motion, frame, foot
    )
    quiet = len(standing) - ramp
    t = np.arange(ramp) / FPS
    run = np.cumsum(smoothstep((t - 0.3 * SHIFT) / RAMP)) / FPS  # the walk's own time
    walk = at_times(motion, frame + run * FPS)
    rest = at_times(motion, np.arange(frame + run[-1] * FPS + 1, len(motion) - 1))
    moved = _mix(
        standing.frames(slice(quiet, None)),
        walk,
        smoothstep(t / (SHIFT + SWING)),
        smoothstep((t - SHIFT) / SWING),
        foot,
    )
    done = join([standing.frames(slice(0, quiet)), moved, rest])
    return replace(done, info=motion.info).tagged("start", f"start{frame}")


def stop(
    motion: PosedMotion,
    frame: int,
    foot: int,
    pose: StandingPose,
    body: BodyModel,
    generator: np.random.Generator,
) -> PosedMotion:
    """Walk to mid-stance `frame`, set the passing foot down beside `foot`, stand."""
    still_for = generator.uniform(1.0, 2.0)
    ramp = round(RAMP * FPS)
    standing = _beside(
        stand(pose, motion.shape, body, still_for + RAMP, generator), motion, frame, foot
    )
    t = np.arange(ramp) / FPS
    left = np.cumsum(smoothstep((t - 0.3 * SHIFT) / RAMP))[::-1]  # frames of the walk still to go
    walk = at_times(motion, frame - left)
    before = at_times(motion, np.arange(frame - left[0] - 1, -1e-6, -1.0)[::-1])
    until_still = t[::-1]
    moved = _mix(
        standing.frames(slice(0, ramp)),
        walk,
        smoothstep(until_still / (SHIFT + SWING)),
        smoothstep((until_still - SHIFT) / SWING),
        foot,
    )
    done = join([before, moved, standing.frames(slice(ramp, None))])
    return replace(done, info=motion.info).tagged("stop", f"stop{frame}")


def _beside(standing: PosedMotion, motion: PosedMotion, frame: int, foot: int) -> PosedMotion:
    """Standing moved so that its `foot` is where the walk has it in `frame`."""
    _, ankle, ball = LEGS[foot]

    def footprint(m: PosedMotion, k: int) -> tuple[Array, float]:
        along = m.places[k, ball, :2] - m.places[k, ankle, :2]
        return m.places[k, ball, :2], float(np.arctan2(along[1], along[0]))

    here, angle = footprint(standing, 0)
    there, wanted = footprint(motion, frame)
    return standing.turned(wanted - angle, here, there)


def _mix(
    standing: PosedMotion, walk: PosedMotion, body_weight: Array, foot_weight: Array, foot: int
) -> PosedMotion:
    """Body from standing (0) to walk (1) by `body_weight`; the free foot by `foot_weight`.

    The carrying foot stays as planted in the standing; where the walk already lifts it
    (`foot_weight` 1), it goes with the walk.
    """
    mixed = blend(standing, walk, body_weight)
    places, world = mixed.places.copy(), mixed.world.copy()
    touch, use = walk.touch.copy(), np.full(len(walk), Use.LOCOMOTION, np.uint8)
    free = blend(standing, walk, foot_weight)
    for leg in (foot, 1 - foot):
        _, ankle, ball = LEGS[leg]
        source = free if leg != foot else walk
        places[:, [ankle, ball]] = source.places[:, [ankle, ball]]
        world[:, [ankle, ball]] = source.world[:, [ankle, ball]]
    lifted = foot_weight > 0.02
    touch[~lifted, 1 - foot] = True
    touch[lifted & (foot_weight < 0.98), 1 - foot] = False
    use[body_weight < 0.02] = Use.STANDING
    return replace(mixed, places=places, world=world, touch=touch, use=use)
