"""Rewards of a generated primitive: named functions (`REWARDS`), paper Eq. 4-9.

Each gives 0…1, higher is better, for a batch of agents: [A]. They look at the body itself, at
its reprojected markers and its hips joint, since that is what viewers see. "Start" is the last
seed frame, in the same frame of reference as the new ones (GAMMA-release takes a stale hips place
from a frame of reference that no longer holds); "end" is the last new frame.

Where the paper and GAMMA-release differ, the paper is followed: the squares in Eq. 7 and 8.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor
from torch.nn.functional import normalize

from wayfarer.motion.quality import FUNCTIONS, Candidate, facing
from wayfarer.spec import FPS

REWARDS: Final = (
    "path",  # Eq. 5: the hips move the way to the goal
    "orientation",  # Eq. 6: the body faces the goal, or the target heading
    "contact",  # Eq. 7: hips keep their height, something stays where it is
    "pose_prior",  # Eq. 8: the pose is a usual one
    "speed",  # exp of the quality term of this name, and so on; not in the paper
    "sliding",
    "upright",
    "seam",
    "goal",  # Eq. 9: how close the agent came in the whole episode
)
"""Rewards of policy training (Eq. 4), each 0…1, higher is better."""

PAPER_REWARD: Final = {
    "path": 1.0,
    "orientation": 1.0,
    "contact": 1.0,
    "pose_prior": 1.0,
    "goal": 1.0,
}
"""Eq. 4. The paper names no β; in GAMMA's code all are 1 but the orientation's, which is 0.5."""

REWARD: Final = PAPER_REWARD | {
    "orientation": 0.5,
    "speed": 1.0,
    "sliding": 0.5,
    "upright": 0.5,
    "seam": 0.5,
}
"""What our policies are trained with."""

REWARD_SCALES: Final = {"speed": 0.3, "sliding": 0.3, "upright": 0.06, "seam": 0.5}
"""Value of a quality term at which its reward has fallen to 1/e: exp(-term / scale)."""


@dataclass(frozen=True)
class PrimitiveOutcome:
    """Input of a reward: one primitive of each agent, frames as in `Candidate`."""

    body: Candidate  # of the body's reprojected markers, [A, 1 + F, M, 3]
    hips: Tensor  # [A, 1 + F, 3]
    pose: Tensor  # [A, F, 32] latent means μ(θ) of the new poses under the pose prior


def path(o: PrimitiveOutcome) -> Tensor:
    """Eq. 5: (1 + cos(angle from the way that the hips moved to the way to the goal)) / 2."""
    start = o.hips[:, 0, :2]
    moved = normalize(o.hips[:, -1, :2] - start, dim=-1)
    wanted = normalize(o.body.goal[:, :2] - start, dim=-1)
    return ((moved * wanted).sum(-1) + 1) / 2


def orientation(o: PrimitiveOutcome) -> Tensor:
    """Eq. 6: (1 + cos(angle from the body's facing to the goal)) / 2 at the end.

    For an agent with a requested facing, the angle to that direction instead.
    """
    return 1 - facing(o.body) / 2


def contact(o: PrimitiveOutcome) -> Tensor:
    """Eq. 7: exp(-|change of the hips' height|) · exp(-min |marker velocity|²), metres and m/s.

    The minimum is over all markers and frames. The speed is squared, as in the paper (in
    GAMMA-release it is not). It is lenient: one still marker in one frame suffices.
    """
    rise = (o.hips[:, -1, 2] - o.hips[:, 0, 2]).abs()
    velocity = (o.body.markers[:, 1:] - o.body.markers[:, :-1]) * FPS
    slowest_squared = (velocity * velocity).sum(-1).amin((1, 2))
    return torch.exp(-rise - slowest_squared)


def pose_prior(o: PrimitiveOutcome) -> Tensor:
    """Eq. 8 with a scale: exp(-|μ(θ)|² / 32), |μ|² averaged over the new frames.

    |μ|² is the squared length, as in the paper (GAMMA-release takes the length). Divided by the
    number of latents: every latent of our prior is in use, so a quite usual pose has |μ|² ≈ 27 and
    the raw form would be 0 for all poses but the one in the middle.
    """
    return torch.exp(-(o.pose * o.pose).mean((-1, -2)))


def from_term(name: str) -> Callable[[PrimitiveOutcome], Tensor]:
    """exp(-term / scale) of a quality term (not in the paper)."""
    return lambda o: torch.exp(-FUNCTIONS[name](o.body) / REWARD_SCALES[name])


def goal(closest: Tensor, area: float, reached: float) -> Tensor:
    """Eq. 9: ((L - d) / L)₊, or 1 within `reached`, the same for all primitives of an episode.

    `closest` [A] is the least distance, over the ends of an agent's primitives, from hips to goal;
    L is the side of the area, 20 m in the paper (GAMMA-release has 10). Metres.
    """
    return torch.where(closest > reached, ((area - closest) / area).clamp(min=0), 1.0)


FUNCTIONS_OF_A_STEP: Mapping[str, Callable[[PrimitiveOutcome], Tensor]] = {
    f.__name__: f for f in (path, orientation, contact, pose_prior)
} | {name: from_term(name) for name in REWARD_SCALES}
if (*FUNCTIONS_OF_A_STEP, goal.__name__) != REWARDS:
    raise ImportError(f"rewards {list(FUNCTIONS_OF_A_STEP)} differ from REWARDS {REWARDS}")


def evaluate(o: PrimitiveOutcome) -> Tensor:
    """All rewards but the goal's, in the order of `REWARDS`. [A, R - 1]"""
    return torch.stack([function(o) for function in FUNCTIONS_OF_A_STEP.values()], -1)
