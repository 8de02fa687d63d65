"""A smooth root for capsules, cameras and root motion: clients/README.md, "Smooth root".

Hips surge and sway with each step. The root does not: it follows the hips' ground point and heading
with an alpha-beta filter, which has no lag while the speed is steady.
"""

import math
from typing import Final

from .bases import Basis
from .quaternions import Array

SMOOTHING: Final = 0.3
"""Seconds: time constant of the critically damped filter."""
JUMP: Final = 2.0
"""Metres (or radians, or seconds between samples) beyond which it starts again, at that place."""


class _Follower:
    """One number that follows another smoothly."""

    def __init__(self) -> None:
        self.value: float | None = None
        self.rate = 0.0

    def follow(self, target: float, step: float, jump: float) -> float:
        if self.value is None or step > JUMP or abs(target - self.value) > jump:
            self.value, self.rate = target, 0.0
        elif step > 0:
            theta = math.exp(-step / SMOOTHING)
            ahead = self.value + self.rate * step
            off = target - ahead
            self.value = ahead + (1 - theta * theta) * off
            self.rate += (1 - theta) ** 2 / step * off
        return self.value


class SmoothRoot:
    """Ground point and heading of an agent, from its sampled poses."""

    def __init__(self, basis: Basis, metres_per_unit: float = 1.0) -> None:
        self._basis = basis
        self._jump = JUMP / metres_per_unit
        self._along = [_Follower(), _Follower(), _Follower()]  # left, forward, up
        self._heading = _Follower()
        self._last: float | None = None

    def update(self, time: float, hips: Array, turn: Array, ground: float) -> tuple[Array, float]:
        """At `time`: hips' place [3] and rotation [4], height of the ground → point [3], heading.

        The heading continues beyond π, so it never jumps.
        """
        step = 0.0 if self._last is None else max(0.0, time - self._last)
        self._last = time
        axes = (self._basis.left, self._basis.forward)
        targets = [*(float(hips @ axis) for axis in axes), ground]
        heading = self._basis.heading(turn)
        if self._heading.value is not None:
            heading += 2 * math.pi * round((self._heading.value - heading) / (2 * math.pi))
        left, forward, up = (
            follower.follow(target, step, self._jump)
            for follower, target in zip(self._along, targets, strict=True)
        )
        heading = self._heading.follow(heading, step, math.inf)
        return left * axes[0] + forward * axes[1] + up * self._basis.up, heading
