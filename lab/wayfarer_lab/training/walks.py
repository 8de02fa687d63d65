"""Recorded windows of steady, straight walking, which the critic of `likeness.py` learns from."""

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from wayfarer.errors import InvalidArgument
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.spec import FPS, GENDERS
from wayfarer_lab.training.dataset import random_betas, unbroken
from wayfarer_lab.training.likeness import FRAMES
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.store import ClipRange, Dataset, mirror
from wayfarer_lab.training.rotation import matrix_from_quaternion

SPEEDS = (0.6, 1.8)
"""m/s of the windows that are compared."""

MOST_BEND = 0.2
"""Radians by which the way of a window's second half may differ from that of its first."""

MOST_CHANGE = 0.25
"""m/s by which the speeds of the halves may differ."""

MOST_ASKEW = 0.4
"""Radians between the way and the mean facing of the hips."""

WINDOWS = 2000
"""Windows of each gender: recorded walks, each on bodies of random shapes."""

PLAIN_STYLES = ("Neutral", "Rushed")
"""Of 100STYLE's styles those that walk as people do."""

SPEED_SPREAD = 0.07
"""m/s: windows at a speed are drawn from so much around it, …"""

FEWEST = 20
"""… and from no fewer than this."""


class Walks:
    """Recorded windows by gender, in order of their speeds."""

    def __init__(
        self, data: Dataset, split: str, bodies: Mapping[str, MarkerBody], windows: int = WINDOWS
    ) -> None:
        """Find them in one split. Raises InvalidArgument when a gender has none."""
        self.markers: dict[str, Tensor] = {}
        self.speeds: dict[str, Tensor] = {}
        for gender in GENDERS:
            hips, rotations, betas = _draw(data, split, gender, windows)
            markers, hips = _reshaped(hips, rotations, betas, bodies[gender])
            speeds = (hips[:, -1, :2] - hips[:, 0, :2]).norm(dim=-1) * FPS / (FRAMES - 1)
            order = speeds.argsort()
            self.markers[gender], self.speeds[gender] = markers[order], speeds[order]

    def like(self, gender: str, speeds: Tensor) -> Tensor:
        """A window [B, FRAMES, 67, 3] at about each of the speeds [B], m/s."""
        known = self.speeds[gender]
        fewest = min(FEWEST, len(known))
        low = torch.searchsorted(known, speeds - SPEED_SPREAD)
        high = torch.searchsorted(known, speeds + SPEED_SPREAD)
        low = torch.minimum(low, high - fewest).clamp(0, len(known) - fewest)
        high = torch.maximum(high, low + fewest).clamp(max=len(known))
        rows = low + (torch.rand(len(speeds)) * (high - low)).long()
        return self.markers[gender][rows]


def is_plain(clip: ClipRange) -> bool:
    """Whether a clip shows, as recorded, somebody who walks as people do.

    Not CMU's acted walks ("walk_styled"), and of 100STYLE's clips ("Style_FW") `PLAIN_STYLES`.
    """
    style, _, _ = clip.name.partition("_")
    styled = clip.name[:1].isalpha() and "_" in clip.name and style not in PLAIN_STYLES
    return clip.augmentation == "" and clip.category != "walk_styled" and not styled


def is_steady(hips: Tensor, facing: Tensor) -> Tensor:
    """Which windows [B] are steady, straight walks.

    Hips [B, T, 3] in metres, Z up; facing [B, T, 2] are horizontal unit vectors.
    """
    half = hips.shape[1] // 2
    first, second = hips[:, half, :2] - hips[:, 0, :2], hips[:, -1, :2] - hips[:, half, :2]
    whole = hips[:, -1, :2] - hips[:, 0, :2]
    lengths = (
        first.norm(dim=-1) * FPS / half,
        second.norm(dim=-1) * FPS / (hips.shape[1] - 1 - half),
    )
    speed = whole.norm(dim=-1) * FPS / (hips.shape[1] - 1)
    return (
        (speed > SPEEDS[0])
        & (speed < SPEEDS[1])
        & ((lengths[0] - lengths[1]).abs() < MOST_CHANGE)
        & (_angle(first, second) < MOST_BEND)
        & (_angle(facing.mean(1), whole) < MOST_ASKEW)
    )


def _angle(a: Tensor, b: Tensor) -> Tensor:
    """Radians between vectors [B, 2]."""
    cosine = (a * b).sum(-1) / (a.norm(dim=-1) * b.norm(dim=-1)).clamp(min=1e-6)
    return cosine.clamp(-1, 1).arccos()


def _draw(data: Dataset, split: str, gender: str, windows: int) -> tuple[Tensor, Tensor, Tensor]:
    """Hips [W, T, 3], rotations [W, T, 22, 4] and betas [W, 10] of recorded windows.

    Drawn with replacement, from recordings and their mirror images; a person's windows weigh less
    the more there are of them (square root).
    """
    hips, rotations, betas, whose = [], [], [], []
    for clip in data.clips:
        if (clip.split, clip.gender, clip.shape) != (split, gender, "own") or not is_plain(clip):
            continue
        frames = slice(clip.start, clip.stop)
        walking = data.use[frames] == Use.LOCOMOTION
        starts = np.flatnonzero(unbroken(walking, np.zeros(len(walking), np.int64)) >= FRAMES)
        rows = torch.from_numpy(starts)[:, None] + torch.arange(FRAMES)
        recorded = (data.translation[frames], data.rotations[frames])
        for places, turns in (recorded, mirror(*recorded, data.contacts[frames])[:2]):
            moved, turned = torch.from_numpy(places)[rows], torch.from_numpy(turns)[rows]
            facing = matrix_from_quaternion(turned[:, :, 0])[..., :2, 1]
            steady = is_steady(moved, facing / facing.norm(dim=-1, keepdim=True).clamp(min=1e-6))
            hips.append(moved[steady])
            rotations.append(turned[steady])
            betas.append(torch.tensor(clip.betas).expand(int(steady.sum()), -1))
            whose += [clip.subject] * int(steady.sum())
    if not whose:
        raise InvalidArgument(
            f"the {split} clips hold no steady {gender} walk of {FRAMES / FPS} s at "
            f"{SPEEDS[0]}…{SPEEDS[1]} m/s for the critic (section [likeness])",
            "data",
        )
    counts = {person: whose.count(person) for person in set(whose)}
    weight = torch.tensor([counts[person] ** -0.5 for person in whose])
    rows = torch.multinomial(weight, windows, replacement=True)
    return torch.cat(hips)[rows], torch.cat(rotations)[rows], torch.cat(betas)[rows].float()


@torch.no_grad()
def _reshaped(
    hips: Tensor, rotations: Tensor, betas: Tensor, body: MarkerBody
) -> tuple[Tensor, Tensor]:
    """Markers [W, T, 67, 3] and hips [W, T, 3] of windows on bodies of random shapes.

    Ways grow with the length of the legs; the lowest sole keeps its height.
    """
    markers, moved = [], []
    for places, turned, own in zip(
        hips.split(250), rotations.split(250), betas.split(250), strict=True
    ):
        other = random_betas(len(own))
        legs = -body.resting(other)[:, 2].amin(-1) / -body.resting(own)[:, 2].amin(-1)
        local, grown = matrix_from_quaternion(turned), places * legs[:, None, None]
        old, _ = body.skin(body.shaped(own), places, local)
        new, _ = body.skin(body.shaped(other), grown, local)
        lift = old[..., 2].amin((1, 2)) - new[..., 2].amin((1, 2))
        new[..., 2] += lift[:, None, None]
        markers.append(new)
        moved.append(grown)
    return torch.cat(markers), torch.cat(moved)
