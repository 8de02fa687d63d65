"""Turning on the spot by stepping: made from a recorded way of standing, without a recorded turn.

Feet step in turn, first the one on the side turned to; while one steps, the hips move over the
other. Hips turn smoothly, the head a little ahead of them. This is geometry, not a recording: it
is tagged `stepturn`, and only widens what little turning from standing the recordings have.
"""

from dataclasses import replace

import numpy as np

from wayfarer.body.model import BodyModel
from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.posed import LEGS, PosedMotion, smoothstep, yaw_matrix
from wayfarer_lab.training.mocap.rig import J
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.shape import RetargetShape
from wayfarer_lab.training.mocap.skeleton import Array
from wayfarer_lab.training.mocap.standing import StandingPose, stand

STEP = 0.5  # seconds from one foot's lift-off to the next one's
SWING_SHARE = 0.8  # of a step in which the foot is off the floor
LIFT = 0.06  # metres
SHIFT = 0.35  # of the distance from the middle to the standing foot
STEP_TURN = np.deg2rad(40)  # of both feet together, so of two steps
LEAD = 0.15  # seconds that the head is ahead


def step_turn(
    pose: StandingPose,
    shape: RetargetShape,
    body: BodyModel,
    angle: float,
    generator: np.random.Generator,
) -> PosedMotion:
    """Stand, turn by `angle` radians (left positive) in steps, stand."""
    pairs = max(1, round(abs(angle) / STEP_TURN))
    wait = generator.uniform(0.5, 1.0)
    turning = 2 * pairs * STEP
    standing = stand(pose, shape, body, 2 * wait + turning, generator)
    t = np.arange(len(standing)) / FPS - wait
    psi = angle * _ramp(t / turning)
    head = angle * _ramp((t + LEAD) / turning)

    centre = standing.places[0, [leg[1] for leg in LEGS], :2].mean(0)
    shift = np.zeros((len(t), 2))
    places, world = standing.places.copy(), yaw_matrix(psi)[:, None] @ standing.world
    for joint, share in ((J["neck"], 0.5), (J["head"], 1.0)):
        world[:, joint] = yaw_matrix((head - psi) * share) @ world[:, joint]
    places = _spun(places, psi, centre)
    touch = np.ones((len(t), 2, 2), bool)
    first = 0 if angle > 0 else 1
    for leg in (0, 1):
        knee, ankle, ball = LEGS[leg]
        turned, height = np.zeros(len(t)), np.zeros(len(t))
        for k in range(pairs):
            begin = (2 * k + (leg != first)) * STEP
            part = (t - begin) / (SWING_SHARE * STEP)
            turned += angle / pairs * smoothstep(part)
            swinging = (part > 0) & (part < 1)
            height += LIFT * np.where(swinging, np.sin(np.pi * np.clip(part, 0, 1)) ** 2, 0)
            touch[swinging, leg] = False
            other = standing.places[0, LEGS[1 - leg][1], :2] - centre
            over = np.sin(np.pi * np.clip((t - begin + 0.1) / (STEP + 0.1), 0, 1)) ** 2
            shift += SHIFT * over[:, None] * (yaw_matrix(psi)[:, :2, :2] @ other)
        foot = _spun(standing.places, turned, centre)
        foot[..., 2] += height[:, None]
        places[:, [ankle, ball]] = foot[:, [ankle, ball]]
        places[:, knee] = (places[:, knee] + foot[:, knee]) / 2
        spin = yaw_matrix(turned - psi)[:, None]
        world[:, [ankle, ball]] = spin @ world[:, [ankle, ball]]
    moving = [
        j for j in range(places.shape[1]) if j not in {leg[k] for leg in LEGS for k in (1, 2)}
    ]
    places[:, moving, :2] += shift[:, None]
    use = np.where((t > 0) & (t < turning), Use.LOCOMOTION, Use.STANDING).astype(np.uint8)
    done = replace(standing, places=places, world=world, touch=touch, use=use)
    info = replace(
        done.info,
        name=f"{pose.source}~stepturn{np.rad2deg(angle):+.0f}",
        category="stepturn",
        augmentation="stepturn",
    )
    return replace(done, info=info)


def _ramp(x: Array) -> Array:
    """0 to 1, at an even rate except near the ends."""
    x = np.clip(x, 0, 1)
    return 0.5 * x + 0.5 * smoothstep(x)


def _spun(places: Array, angle: Array, centre: Array) -> Array:
    spun = places.copy()
    spun[..., :2] = np.einsum(
        "nij,nkj->nki", yaw_matrix(angle)[:, :2, :2], places[..., :2] - centre
    )
    spun[..., :2] += centre
    return spun
