"""How hips move over feet: they rise and fall with each step, and sway over the foot that bears.

Metres, world space; [F, A] frames and agents, [2, F, A] left and right foot.
"""

from typing import Final

import numpy as np

from wayfarer.world.output.legs import LegPose, Legs
from wayfarer.world.output.quaternion import Array, bounded, length, smooth

RAISED: Final = 0.006
LOWERED: Final = 0.013
"""Metres by which hips are raised over feet that are `CLOSE` to each other, as far as knees are
bent, and lowered over those that are `WIDE` apart: people come down with each step."""

STRAIGHTENED: Final = 0.85
"""Share of what bent knees take off the shorter leg by which the hips of who stands upright are
raised instead; legs reach that far without being eased, see `twobone.FREE`."""

SWAY: Final = 0.016
SURGE: Final = 0.009
"""Metres by which hips are moved aside, over the foot that bears, and along their way: the model's
hips glide, as if on wheels. For steps of `AMPLE` and more; for smaller ones in proportion."""

AMPLE: Final = 0.5
"""Metres from ankle to ankle, along the facing, …"""

LONG: Final = (0.66, 0.80)
"""… between which steps are so long that the model's hips surge by themselves, more and more."""

STILL: Final = 0.6
"""Metres per second: what both feet together are slower than is no step."""

CLOSE: Final = 0.2
WIDE: Final = 0.75
"""Metres from ankle to ankle."""


def lower_hips(
    pose: LegPose, legs: Legs, drawn: Array | None, shifts: Array, upright: Array
) -> Array:
    """Metres by which hips are lowered over their feet [F, A], which are moved by `shifts`
    [3, 2, F, A]; over those of who stands upright [F, A] they are raised.
    """
    ankle = pose.ankle[:2] if drawn is None else pose.ankle[:2] + drawn
    apart = ankle[:, 0] - ankle[:, 1]
    square = bounded((apart * apart).sum(0), CLOSE**2, WIDE**2)
    wide = (square - CLOSE**2) / (WIDE**2 - CLOSE**2)
    leg = (length(legs.knee.T) + length(legs.ankle.T))[:, None]  # [2, 1, A]
    spare = (leg - length(pose.ankle - pose.hip)).min(0)  # straight knees lift nobody
    walking = LOWERED * wide - np.minimum(RAISED, spare / 2) * (1 - wide)
    placed = pose.ankle - pose.hip
    placed[:2] += shifts[:2] if drawn is None else shifts[:2] + drawn
    straight = -STRAIGHTENED * np.maximum((leg - length(placed)).min(0), 0)
    found: Array = walking + upright * (straight - walking)
    return found


def sway_hips(along: Array, facing: Array, speed: Array, reach: Array) -> Array:
    """Metres [2, F, A] by which hips are moved that face `facing` [2, F, A], with ankles `along`
    [2, F, A] that way, sole speeds [2, F, A] and feet that get ahead of each other by `reach`
    [2, F, A].

    A half of a sine in each step aside, to the foot that bears, and a whole one along. Both are
    zero when the feet are farthest apart and the weight goes from one foot to the other.
    """
    stride = reach.mean(0)
    phase = bounded((along[0] - along[1]) / np.maximum(stride, 0.1), -1, 1)
    on_left = (speed[1] - speed[0]) / np.maximum(speed[0] + speed[1], STILL)  # 1: on the left foot
    strong = on_left * np.minimum(stride / AMPLE, 1)
    aside = -SWAY * strong * np.cos(np.pi / 2 * phase)  # to the right
    ahead = SURGE * strong * (1 - smooth(stride, *LONG)) * np.sin(np.pi * phase)
    x, y = facing
    return np.stack([ahead * x + aside * y, ahead * y - aside * x]).astype(np.float32)
