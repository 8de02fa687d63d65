"""A few clips of made-up marker motion: rigid clouds gliding forward, quick to learn."""

import numpy as np
import torch

from wayfarer.spec import FPS, GENDERS, MARKERS
from wayfarer_lab.training.dataset import Frames
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.store import ClipRange, Dataset


def gliding_frames(clips: int = 4, length: int = 90, seed: int = 0) -> Frames:
    generator = torch.Generator().manual_seed(seed)
    cloud = torch.randn(MARKERS, 3, generator=generator) * 0.3
    hips, markers, run = [], [], []
    for _ in range(clips):
        speed = 0.5 + torch.rand(1, generator=generator)
        time = torch.arange(length) / FPS
        place = torch.stack([torch.zeros(length), speed * time, torch.full((length,), 0.9)], -1)
        hips.append(place)
        markers.append(cloud + place[:, None])
        run.append(torch.arange(length, 0, -1))
    n = clips * length
    identity = torch.tensor([0.0, 0, 0, 1]).expand(n, 22, 4)
    return Frames(
        markers=torch.cat(markers),
        hips=torch.cat(hips),
        hips_rotation=torch.eye(3).expand(n, 3, 3),
        rotations=identity,
        run=torch.cat(run),
        weight=torch.ones(n),
        betas=torch.zeros(n, 10),
        gender=torch.arange(n) // length % 2,
    )


def straight_walks(
    speeds: tuple[float, ...] = (0.8, 1.2, 1.6), name: str = "07_01", length: int = 90
) -> Dataset:
    """Bodies in the T-pose that glide along +Y, a clip for each gender and speed."""
    hips, clips = [], []
    for gender in GENDERS:
        for number, speed in enumerate(speeds):
            place = np.zeros((length, 3), np.float32)
            place[:, 1], place[:, 2] = speed * np.arange(length) / FPS, 1.0
            start = len(clips) * length
            hips.append(place)
            clips.append(
                ClipRange(
                    start, start + length, name, name, str(number), "train", "walk", True, gender,
                    (0.0,) * 10, "own", "",
                )
            )  # fmt: skip
    n = len(clips) * length
    rotations = np.zeros((n, 22, 4), np.float32)
    rotations[..., 3] = 1
    return Dataset(
        translation=np.concatenate(hips),
        rotations=rotations,
        contacts=np.ones((n, 2), bool),
        use=np.full(n, Use.LOCOMOTION, np.uint8),
        clips=tuple(clips),
    )
