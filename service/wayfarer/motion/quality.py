"""Quality terms of a primitive: named functions of markers, lower is better (`terms.TERMS`).

Shared by candidate search, policy reward and evaluation. Markers are in any frame whose floor is
z = 0, metres. Shapes: [..., F, M, 3]; every term returns [...].
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from wayfarer.errors import InvalidArgument
from wayfarer.motion.constants import indices
from wayfarer.motion.obstacles import intrusion
from wayfarer.spec import FPS
from wayfarer.terms import TERMS

NEAR_GOAL = 0.25
"""Metres: nearer than this, the direction of a goal is mostly noise."""

FOOT_HEIGHT = 0.03
"""Metres: a sole marker below it may bear weight."""

LEANING = 0.034
"""1 - cos(15°): recorded walks lean by 8° in the mean (`trunk_tilt_deg`)."""

SAFE = 1e-9
"""Keeps square roots differentiable and normalisation finite at zero."""


@dataclass(frozen=True)
class Sites:
    """Indices of the markers that the terms look at."""

    left_waist: list[int]
    right_waist: list[int]
    chest: list[int]
    left_sole: list[int]
    right_sole: list[int]
    left_ankle: int
    right_ankle: int
    outline: list[int]
    """How far the body reaches, seen from above."""

    @classmethod
    def from_names(cls, names: Sequence[str]) -> "Sites":
        """Finds them by name. Raises InvalidArgument when one is missing."""

        def find(*wanted: str) -> list[int]:
            missing = [w for w in wanted if w not in names]
            if missing:
                raise InvalidArgument(f"the body lacks markers {missing}; it has {list(names)}")
            return [list(names).index(w) for w in wanted]

        reaching = ("SHO", "ELB", "FIN", "HIP", "KNE", "TOE")
        sole = ("SOLE_HEEL", "SOLE_MT1", "SOLE_MT5", "SOLE_TOE")
        return cls(
            left_waist=find("LFWT", "LBWT"),
            right_waist=find("RFWT", "RBWT"),
            chest=find("C7", "CLAV"),
            left_sole=find(*("L" + s for s in sole)),
            right_sole=find(*("R" + s for s in sole)),
            left_ankle=find("LANK")[0],
            right_ankle=find("RANK")[0],
            outline=find(*(side + name for side in "LR" for name in reaching)),
        )


@dataclass(frozen=True)
class Candidate:
    """Input of a term: the new frames, after the last seed frame."""

    markers: Tensor  # [..., 1 + F, M, 3]
    velocity: Tensor  # [..., M, 3] from the frame before the last seed frame to it, metres a frame
    goal: Tensor  # [..., 3]
    target_speed: Tensor  # [...]
    wished_facing: Tensor  # [..., 2] horizontal unit vector, or zero: the way to the goal
    obstacles: Tensor  # [..., O, 7], see `obstacles.py`
    sites: Sites

    def waist(self, frame: int) -> Tensor:
        """Centre of the waist, used for the hips. [..., 3]"""
        both = self.sites.left_waist + self.sites.right_waist
        return take(self.markers[..., frame, :, :], both).mean(-2)

    def facing(self) -> Tensor:
        """Horizontal unit vector the body faces in the last frame. [..., 2]"""
        last = self.markers[..., -1, :, :2]
        across = take(last, self.sites.right_waist).mean(-2)
        across = across - take(last, self.sites.left_waist).mean(-2)
        return _unit(torch.stack([-across[..., 1], across[..., 0]], -1))

    def tilt(self) -> Tensor:
        """1 - cos(tilt of the trunk) in the last frame. [...]"""
        chest = take(self.markers[..., -1, :, :], self.sites.chest).mean(-2)
        return 1 - _unit(chest - self.waist(-1))[..., 2]

    def soles(self) -> Tensor:
        """Markers under both feet. [..., 1 + F, 8, 3]"""
        return take(self.markers, self.sites.left_sole + self.sites.right_sole)


def goal_distance(c: Candidate) -> Tensor:
    """Horizontal metres from the hips to the goal at the end."""
    return _length(c.goal[..., :2] - c.waist(-1)[..., :2])


def facing(c: Candidate) -> Tensor:
    """1 - cos(angle from the body's facing to the wished one, or to the goal) (Eq. 6 as a cost).

    The way to a goal a step away says little, and less the nearer the goal is.
    """
    way = c.goal[..., :2] - c.waist(-1)[..., :2]
    to_goal = way / torch.sqrt((way * way).sum(-1, keepdim=True) + NEAR_GOAL**2)
    wished = (c.wished_facing**2).sum(-1, keepdim=True)  # 1 or 0
    return 1 - (c.facing() * (c.wished_facing + (1 - wished) * to_goal)).sum(-1)


def speed(c: Candidate) -> Tensor:
    """Difference of mean horizontal hips speed from the wished speed, m/s, whatever the direction.

    Counted towards the goal only, an agent that faces away would rather stop than walk a curve.
    """
    seconds = (c.markers.shape[-3] - 1) / FPS
    moved = _length(c.waist(-1)[..., :2] - c.waist(0)[..., :2])
    return (moved / seconds - c.target_speed).abs()


def floating(c: Candidate) -> Tensor:
    """Mean height of the lowest sole marker above the floor (Eq. 11's height, per frame)."""
    return c.soles()[..., 2].amin(-1).clamp(min=0).mean(-1)


def sinking(c: Candidate) -> Tensor:
    """Mean depth of the lowest sole marker below the floor."""
    return (-c.soles()[..., 2].amin(-1)).clamp(min=0).mean(-1)


def skating(c: Candidate) -> Tensor:
    """Mean over frames of the horizontal speed of the slowest sole marker, m/s (Eq. 11's speed)."""
    soles = c.soles()
    step = soles[..., 1:, :, :2] - soles[..., :-1, :, :2]
    return (_length(step).amin(-1) * FPS).mean(-1)


def sliding(c: Candidate) -> Tensor:
    """Horizontal speed of each foot's lowest marker, m/s, mean over feet and frames.

    It counts less the higher that marker is, and not at all from 3 cm on. Both feet are watched,
    while `skating` watches one (after the skate measure of DART).
    """
    speeds = []
    for markers in c.soles().split(len(c.sites.left_sole), -2):
        speed = _length(markers[..., 1:, :, :2] - markers[..., :-1, :, :2]) * FPS
        height = torch.maximum(markers[..., 1:, :, 2], markers[..., :-1, :, 2])
        speeds.append((speed * (1 - height / FOOT_HEIGHT).clamp(0, 1)).amax(-1))
    return torch.stack(speeds, -1).mean((-1, -2))


def upright(c: Candidate) -> Tensor:
    """`Candidate.tilt`, with ten times the excess over `LEANING`.

    A walk leans by a few degrees, which should cost little; a person who turns fast may lean far.
    """
    leaning = c.tilt()
    return leaning + 9 * (leaning - LEANING).clamp(min=0)


def stillness(c: Candidate) -> Tensor:
    """Mean speed of all markers, m/s."""
    return (_length(c.markers[..., 1:, :, :] - c.markers[..., :-1, :, :]) * FPS).mean((-1, -2))


def feet_apart(c: Candidate) -> Tensor:
    """Metres from ankle to ankle along the facing direction in the last frame: the stride."""
    last = c.markers[..., -1, :, :2]
    between = last[..., c.sites.left_ankle, :] - last[..., c.sites.right_ankle, :]
    return (between * c.facing()).sum(-1).abs()


def seam(c: Candidate) -> Tensor:
    """Mean over markers of the change of velocity across the seam, m/s: it shows as a jerk."""
    first = c.markers[..., 1, :, :] - c.markers[..., 0, :, :]
    return (_length(first - c.velocity) * FPS).mean(-1)


def clearance(c: Candidate) -> Tensor:
    """Metres by which the body comes too near to obstacles, mean over frames."""
    return intrusion(take(c.markers, c.sites.outline), c.obstacles)


FUNCTIONS: dict[str, Callable[[Candidate], Tensor]] = {
    f.__name__: f
    for f in (
        goal_distance,
        facing,
        speed,
        floating,
        sinking,
        skating,
        sliding,
        upright,
        stillness,
        feet_apart,
        seam,
        clearance,
    )
}
if tuple(FUNCTIONS) != TERMS:
    raise ImportError(f"quality functions {list(FUNCTIONS)} differ from terms.TERMS {list(TERMS)}")


def evaluate(candidate: Candidate) -> Tensor:
    """All terms in the order of `TERMS`. [..., T]"""
    return torch.stack([function(candidate) for function in FUNCTIONS.values()], -1)


CONTACT_HEIGHT: Final = 0.03
"""Metres: a sole marker lower than this touches the floor."""
CONTACT_SPEED: Final = 0.25
"""m/s: a marker slower than this, horizontally, stands still."""


def foot_contacts(soles: Tensor) -> Tensor:
    """Feet that touch the floor and stand still: soles [..., 1 + F, 2, 4, 3] → 0 or 1 [..., F, 2].

    A foot is in contact when one of its sole markers does both.
    """
    step = _length(soles[..., 1:, :, :, :2] - soles[..., :-1, :, :, :2]) * FPS
    touching = (soles[..., 1:, :, :, 2] < CONTACT_HEIGHT) & (step < CONTACT_SPEED)
    return touching.any(-1).to(soles.dtype)


def take(markers: Tensor, which: Sequence[int]) -> Tensor:
    """Some of the markers [..., M, 3]: one plain gather; brackets would export as a chain."""
    return markers.index_select(-2, indices(which, markers))


def _length(v: Tensor) -> Tensor:
    return torch.sqrt((v * v).sum(-1) + SAFE * SAFE)


def _unit(v: Tensor) -> Tensor:
    return v / torch.sqrt((v * v).sum(-1, keepdim=True) + SAFE)
