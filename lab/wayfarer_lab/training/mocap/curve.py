"""Bend a walk: the hips follow a turned path, each stance foot stays where it was put.

The path is turned by ψ(t), the integral of a yaw rate. A foot on the floor is carried by the
transform of the *middle* of its stance, so it neither slides nor twists; between stances that
instant moves smoothly to the next one. The fit then bends the legs to reach both.
"""

from dataclasses import replace

import numpy as np

from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.posed import (
    LEGS,
    PosedMotion,
    hips_speed,
    smoothstep,
    stances,
    yaw_matrix,
)
from wayfarer_lab.training.mocap.skeleton import Array

MAX_SIDEWAYS = 1.3  # m/s²: speed times yaw rate that a walker takes without leaning
FULL_RATE_SPEED = 0.5  # m/s: below it the yaw rate fades, since feet that stand cannot turn
ONSET = 0.5  # seconds over which the yaw rate builds up


def curve(motion: PosedMotion, rate: float, onset_at: float = 0.0) -> PosedMotion:
    """The motion on a path that turns by `rate` rad/s (left positive) from `onset_at` seconds.

    The rate is limited by `MAX_SIDEWAYS` at each speed.
    """
    seconds = np.arange(len(motion)) / FPS
    speed = hips_speed(motion)
    limit = MAX_SIDEWAYS / np.maximum(speed, 0.1)
    yaw_rate = np.clip(rate, -limit, limit) * smoothstep((seconds - onset_at) / ONSET)
    yaw_rate = yaw_rate * smoothstep(speed / FULL_RATE_SPEED)
    psi = np.concatenate([[0.0], np.cumsum((yaw_rate[1:] + yaw_rate[:-1]) / 2)]) / FPS

    hips = motion.places[:, 0, :2]
    steps = np.einsum("nij,nj->ni", yaw_matrix(psi)[:-1, :2, :2], np.diff(hips, axis=0))
    path = hips[0] + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])

    places = _carry(motion.places, np.arange(len(motion)), hips, path, psi)
    world = yaw_matrix(psi)[:, None] @ motion.world
    for foot, (knee, ankle, ball) in enumerate(LEGS):
        when = _carrying_instant(motion.touch[:, foot], len(motion))
        carried = _carry(motion.places, when, hips, path, psi)
        turn = yaw_matrix(np.interp(when, np.arange(len(psi)), psi))
        half = yaw_matrix((np.interp(when, np.arange(len(psi)), psi) + psi) / 2)
        places[:, [ankle, ball]] = carried[:, [ankle, ball]]
        places[:, knee] = (places[:, knee] + carried[:, knee]) / 2
        world[:, [ankle, ball]] = turn[:, None] @ motion.world[:, [ankle, ball]]
        world[:, knee] = half @ motion.world[:, knee]
    return replace(motion, places=places, world=world).tagged("curve", f"curve{rate:+.2f}")


def _carry(places: Array, when: Array, hips: Array, path: Array, psi: Array) -> Array:
    """Places of each frame moved by the path's transform of instant `when` [N] (fractional)."""
    frames = np.arange(len(psi))
    angle = np.interp(when, frames, psi)
    origin = np.stack([np.interp(when, frames, hips[:, k]) for k in range(2)], -1)
    target = np.stack([np.interp(when, frames, path[:, k]) for k in range(2)], -1)
    moved = places.copy()
    relative = places[..., :2] - origin[:, None]
    moved[..., :2] = (
        np.einsum("nij,nkj->nki", yaw_matrix(angle)[:, :2, :2], relative) + target[:, None]
    )
    return moved


def _carrying_instant(touch: Array, length: int) -> Array:
    """For each frame the instant whose transform carries this foot [N]."""
    ranges = stances(touch)
    if not ranges:
        return np.arange(length, dtype=float)
    instant = np.empty(length)
    middles = [(a + b - 1) / 2 for a, b in ranges]
    # a stance cut off by the clip's edge still has its middle within what is seen
    first, last = ranges[0][0], ranges[-1][1]
    instant[:first] = middles[0]
    instant[last:] = middles[-1]
    # a foot that swings at the clip's edges moves on with the body
    instant[:first] -= smoothstep((first - np.arange(first)) / 12) * (first - np.arange(first))
    after = np.arange(length - last)
    instant[last:] += smoothstep(after / 12) * after
    for (a, b), middle in zip(ranges, middles, strict=True):
        instant[a:b] = middle
    for (_, b), (a, _), m0, m1 in zip(ranges, ranges[1:], middles, middles[1:], strict=False):
        part = smoothstep((np.arange(b, a) - b + 1) / (a - b + 1))
        instant[b:a] = m0 + (m1 - m0) * part
    return np.clip(instant, 0, length - 1)
