"""The trajectory that is asked of a body: where it should be, and face, a moment ahead.

A recorded person's own future shows what the person was about to do. So a policy can learn from
recordings which latent leads where (`lab/wayfarer_lab/training/cloning.py`). While it serves, the
same numbers are computed here from the request: a goal, a speed and a facing. They are those of
motion matching (Clavet, GDC 2016): velocities and headings that approach their targets
exponentially. So does the way to a stop.
"""

from math import cos, sin
from typing import Final, NamedTuple

import torch
from torch import Tensor

from wayfarer.motion.constants import numbers
from wayfarer.spec import FPS, MARKERS

HORIZONS: Final = (8, 20, 40)
"""Frames ahead of the last seed frame: .2, .5 and 1 s."""

EASE: Final = 0.3
"""Seconds in which a velocity comes to 1/e of its target, as recorded people set off."""

SURGE: Final = 5.0
"""Greatest change of a velocity that is asked, m/s² (recorded people, path smoothed over .12 s: 4.4
at the 99th percentile, 6.1 at the 99.9th)."""

BRAKE: Final = 0.6
"""Seconds: the requested speed is at most the way to the goal divided by this."""

SETTLE: Final = 0.45
"""Seconds in which the way to the goal comes to 1/e at the earliest."""

CREEP: Final = 0.3
"""Greatest speed of a standing body back to the place where it should stand, m/s."""

TURN_MOST: Final = 2.6
"""Greatest speed of a turn, radians per second (recorded: 83 to 230 °/s)."""

NEAR: Final = 0.3
"""Metres: the direction of a nearer goal fades out as a facing."""


class Asked(NamedTuple):
    """Input of a policy, canonical frame of the seed. H horizons."""

    ways: Tensor  # [A, H, 2] metres from the hips of the last seed frame
    facings: Tensor  # [A, H, 2] unit vectors


def asked_of(seed: Tensor, goal: Tensor, speed: Tensor, facing: Tensor) -> Asked:
    """The trajectory towards a goal.

    seed [A, S, 201]: markers in their canonical frame. goal [A, 3]: metres, in that frame. speed
    [A]: m/s; 0: come to rest at the goal. facing [A, 2]: unit vector, or zero: the way to the goal.
    """
    moved, velocity = motion_of(seed)
    way = goal[:, :2] - moved  # the canonical origin lies under the hips of the first seed frame
    distance = _length(way)
    most = torch.maximum(speed[:, None], numbers((CREEP,), speed))
    aim = way / distance * torch.minimum(most, distance / BRAKE)
    change = aim - velocity
    size = _length(change)
    aim = velocity + change * torch.minimum(torch.ones_like(size), SURGE * EASE / size)
    seconds = numbers([h / FPS for h in HORIZONS], seed)[None, :, None]
    ways = approach(velocity, aim, seconds)
    # no request leads past the goal
    settled = 1 - torch.exp(-seconds / SETTLE)
    along, left = _length(ways), distance[:, None] * settled
    ways = ways * torch.minimum(torch.ones_like(along), left / along)
    return Asked(ways, _facings(seed, way, distance, facing))


def motion_of(seed: Tensor) -> tuple[Tensor, Tensor]:
    """The way from the first to the last frame of a seed [A, S, 201] in metres [A, 2], and m/s."""
    # of all markers: the swing of limbs cancels. The export would name a mean like an output.
    points = seed.unflatten(-1, (MARKERS, 3))[..., :2].sum(2) / MARKERS
    moved = points[:, -1] - points[:, 0]
    return moved, moved * (FPS / max(1, seed.shape[1] - 1))


def approach(velocity: Tensor, aim: Tensor, seconds: Tensor) -> Tensor:
    """Ways [A, H, 2] after `seconds` [1, H, 1], while a velocity [A, 2] comes to its aim [A, 2]."""
    eased = EASE * (1 - torch.exp(-seconds / EASE))
    return aim[:, None] * seconds + (velocity - aim)[:, None] * eased


def _facings(seed: Tensor, way: Tensor, distance: Tensor, facing: Tensor) -> Tensor:
    """Facings [A, H, 2] on the way from the seed's, +Y, to the requested one.

    7/16, 3/4 and 15/16 of an angle are turned at the horizons: 1 - exp(-t / .35 s). Angles are
    halved and added as sines and cosines, since exported functions of angles round a row
    differently in other batches.
    """
    given = (facing * facing).sum(-1, keepdim=True)  # 1 or 0
    share = distance / (distance + NEAR)
    ahead = numbers((0.0, 1.0), seed)
    wished = facing * given + (1 - given) * (share * way / distance + (1 - share) * ahead)
    wished = wished / _length(wished)
    half = _halved(_Turn(wished[:, 1:], -wished[:, :1]))  # to the left is positive
    quarter = _halved(half)
    eighth = _halved(quarter)
    sixteenth = _halved(eighth)
    most = [
        quarter.and_(eighth).and_(sixteenth),
        half.and_(quarter),
        half.and_(quarter).and_(eighth).and_(sixteenth),
    ]
    turns = [turn.at_most(TURN_MOST * h / FPS) for turn, h in zip(most, HORIZONS, strict=True)]
    return torch.stack([torch.cat([-turn.sin, turn.cos], -1) for turn in turns], 1)


class _Turn(NamedTuple):
    """Angles from -π to π, each [A, 1]."""

    cos: Tensor
    sin: Tensor

    def and_(self, other: "_Turn") -> "_Turn":
        """The sum of both."""
        return _Turn(
            self.cos * other.cos - self.sin * other.sin,
            self.sin * other.cos + self.cos * other.sin,
        )

    def at_most(self, angle: float) -> "_Turn":
        """The same, but no farther than `angle` to either side."""
        far = self.cos < cos(angle)
        side = torch.where(self.sin < 0, -sin(angle), sin(angle))
        return _Turn(
            torch.where(far, torch.full_like(self.cos, cos(angle)), self.cos),
            torch.where(far, side, self.sin),
        )


def _halved(turn: _Turn) -> _Turn:
    """Half of each angle."""
    sine = torch.sqrt((0.5 - 0.5 * turn.cos).clamp(min=0))
    return _Turn(
        torch.sqrt((0.5 + 0.5 * turn.cos).clamp(min=0)), torch.where(turn.sin < 0, -sine, sine)
    )


def _length(v: Tensor) -> Tensor:
    """[..., 2] → [..., 1], never 0."""
    return torch.sqrt((v * v).sum(-1, keepdim=True) + 1e-6)
