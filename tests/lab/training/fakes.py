"""A few clips of made-up marker motion: rigid clouds gliding forward, quick to learn."""

import torch

from wayfarer.spec import FPS, MARKERS
from wayfarer_lab.training.dataset import Frames


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
