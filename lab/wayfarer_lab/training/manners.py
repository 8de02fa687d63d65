"""The manner of a motion: eight numbers that tell apart people that do the same.

A window of .8 s has a way. Its features are means and standard deviations of the markers against
the hips. A small network learns which features are usual for a way and a body's shape, and how much
they vary. The difference, in these units and averaged over 3 s, is projected on its eight principal
components among recorded people, each scaled to variance 1. So a recorded stretch has a manner, and
an agent draws its own from N(0, I).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import torch
from torch import Tensor, nn

from wayfarer.motion.marker_body import MarkerBody
from wayfarer.spec import BETAS, FPS, GENDERS, MANNER, MARKERS
from wayfarer_lab.training.dataset import Frames, WindowSampler, random_betas
from wayfarer_lab.training.rotation import matrix_from_quaternion
from wayfarer_lab.training.run import cosine_rate
from wayfarer_lab.training.views import EVERY, BodyFrames

LENGTH: Final = round(0.8 * FPS) + 1
"""Frames of a window."""

STRETCH: Final = 3.0
"""Seconds over whose windows a recorded manner is a mean."""

APART: Final = 8
"""Frames from one of these windows to the next."""

DRAWN: Final = 24_576
"""Recorded windows from which it is learnt what is usual, at most."""

BATCH: Final = 512

PASSES: Final = 31
"""Times that each is seen."""

RATE: Final = 2e-3

MOST: Final = 2.5
"""Greatest number of a manner, standard deviations."""

WAY: Final = 5
"""Numbers of a way, see `BodyFrames.ways`."""

FEATURES: Final = 2 * MARKERS * 3


class Manners(nn.Module):
    """The usual features of a way, and the directions in which people differ from them."""

    base: Tensor
    basis: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.usual = nn.Sequential(
            nn.Linear(WAY + BETAS + len(GENDERS), 192),
            nn.ELU(),
            nn.Linear(192, 192),
            nn.ELU(),
            nn.Linear(192, 2 * FEATURES),
        )
        self.register_buffer("base", torch.zeros(FEATURES))
        self.register_buffer("basis", torch.zeros(FEATURES, MANNER))

    def unusual(self, view: BodyFrames, betas: Tensor, gender: int) -> Tensor:
        """By how many deviations bodies `betas` [A, 10] differ from what is usual [A, 402]."""
        mean, log_spread = self._usual(view, betas, gender)
        return (features(view) - mean) * torch.exp(-log_spread)

    def _usual(self, view: BodyFrames, betas: Tensor, gender: int) -> tuple[Tensor, Tensor]:
        kind = torch.zeros(len(betas), len(GENDERS))
        kind[:, gender] = 1
        mean, log_spread = self.usual(torch.cat([view.ways(), betas, kind], -1)).chunk(2, -1)
        return mean, log_spread.clamp(-7, 2)

    def surprise(self, view: BodyFrames, betas: Tensor, gender: int) -> Tensor:
        """Negative log likelihood of recorded windows, mean."""
        _, log_spread = self._usual(view, betas, gender)
        return (0.5 * self.unusual(view, betas, gender) ** 2 + log_spread).mean()


def features(view: BodyFrames) -> Tensor:
    """Means and deviations of markers against the hips, facing +Y [A, 402]."""
    facing = view.turns[..., :2, 1]
    x, y = (facing / facing.norm(dim=-1, keepdim=True).clamp(min=1e-6)).unbind(-1)
    turn = torch.stack([torch.stack([y, x], -1), torch.stack([-x, y], -1)], -2)  # [A, T, 2, 2]
    away = view.markers - view.hips[:, :, None]
    local = torch.cat([away[..., :2] @ turn, away[..., 2:]], -1)
    return torch.cat([local.mean(1), (local.var(1) + 1e-6).sqrt()], 1).flatten(1)


def measured(frames: Frames, bodies: Sequence[MarkerBody]) -> Manners:
    """Learns from recorded people, without acted styles. `bodies`: one of each gender.

    Takes a minute or two, and leaves the state of random numbers as it was.
    """
    state = torch.get_rng_state()
    torch.manual_seed(0)
    manners = Manners()
    _learn(manners, frames, bodies)
    starts, unusual = _unusual(manners, frames, bodies)
    weight = (frames.weight * ~frames.acted)[starts]
    weight = (weight / weight.sum())[:, None]
    manners.base.copy_((weight * unusual).sum(0))
    off = unusual - manners.base
    found, axes = torch.linalg.eigh(off.T @ (weight * off))
    manners.basis.copy_((axes / found.clamp(min=1e-9).sqrt())[:, -MANNER:].flip(-1))
    torch.set_rng_state(state)
    return manners.requires_grad_(False)


def recorded(manners: Manners, frames: Frames, bodies: Sequence[MarkerBody]) -> Tensor:
    """The manner of each frame [N, 8]; 0 in unbroken stretches that are shorter than a window."""
    starts, unusual = _unusual(manners, frames, bodies)
    shown = ((unusual - manners.base) @ manners.basis).clamp(-MOST, MOST)
    each = torch.arange(len(frames.run))
    ends, own = starts + frames.run[starts], each + frames.run
    after = torch.searchsorted(starts + LENGTH // 2, each).clamp(max=len(starts) - 1)
    window = torch.where(ends[after] == own, after, (after - 1).clamp(min=0))
    return shown[window] * (ends[window] == own)[:, None]


def _learn(manners: Manners, frames: Frames, bodies: Sequence[MarkerBody]) -> None:
    natural = replace(frames, weight=frames.weight * ~frames.acted)
    sampler = WindowSampler(natural, LENGTH)
    starts = sampler.draw(min(DRAWN, 2 * len(sampler.index)))
    shown = [
        (*_view(frames, rows, body), gender)
        for gender, body in enumerate(bodies)
        for rows in starts[gender :: len(bodies)].split(BATCH)
    ]
    optimizer = torch.optim.Adam(manners.usual.parameters())
    steps = PASSES * len(shown)
    for step in range(steps):
        for group in optimizer.param_groups:
            group["lr"] = cosine_rate(RATE, step, steps)
        view, betas, gender = shown[int(torch.randint(len(shown), ()))]
        optimizer.zero_grad()
        manners.surprise(view, betas, gender).backward()
        optimizer.step()


@torch.no_grad()
def _unusual(
    manners: Manners, frames: Frames, bodies: Sequence[MarkerBody]
) -> tuple[Tensor, Tensor]:
    """Starts [W] of windows, and by how much those around each differ from what is usual."""
    starts = torch.nonzero(frames.run >= LENGTH).squeeze(-1)
    starts = starts[starts % APART == 0]
    found = torch.empty(len(starts), FEATURES)
    for rows in torch.arange(len(starts)).split(1024):
        for gender, body in enumerate(bodies):
            mine = rows[frames.gender[starts[rows]] == gender]
            if len(mine):
                view, betas = _view(frames, starts[mine], body)
                found[mine] = manners.unusual(view, betas, gender)
    # the mean of windows around each, of the same unbroken stretch
    ends = starts + frames.run[starts]
    total, count = found.clone(), torch.ones(len(starts), 1)
    for step in range(1, round(STRETCH * FPS / APART / 2) + 1):
        same = (ends[step:] == ends[:-step])[:, None].float()
        total[:-step] += same * found[step:]
        total[step:] += same * found[:-step]
        count[:-step] += same
        count[step:] += same
    return starts, total / count


@torch.no_grad()
def _view(frames: Frames, starts: Tensor, body: MarkerBody) -> tuple[BodyFrames, Tensor]:
    """Windows on bodies of random shapes, and these [A, 10]."""
    rows = starts[:, None] + torch.arange(0, LENGTH, EVERY)
    betas, hips = random_betas(len(starts)), frames.hips[rows]
    rotations = matrix_from_quaternion(frames.rotations[rows])
    markers, _ = body.skin(body.shaped(betas), hips, rotations)
    return BodyFrames(markers, hips, rotations[:, :, 0]), betas
