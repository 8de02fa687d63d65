"""A few clips of made-up marker motion: rigid clouds gliding forward, quick to learn."""

import numpy as np
import torch

from wayfarer.engines.torch.marker_bodies import load_marker_bodies
from wayfarer.spec import FPS, GENDERS, MARKERS
from wayfarer_lab.training.dataset import Frames, skin_frames
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.store import ClipRange, Dataset
from wayfarer_lab.training.rotation import (
    matrix_from_quaternion,
    matrix_from_rotvec,
    quaternion_from_matrix,
)


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
        acted=torch.zeros(n, dtype=torch.bool),
    )


def walking_frames(clips: int = 4, length: int = 60, seed: int = 0) -> Frames:
    """Bodies of both genders and different shapes that swing their joints along a curved way."""
    generator = torch.Generator().manual_seed(seed)
    time = torch.arange(length)[:, None, None] / FPS
    hips, rotations, betas = [], [], []
    for _ in range(clips):
        swing = 0.3 * torch.randn(1, 22, 3, generator=generator)
        turns = swing * torch.sin(5 * time + 6 * torch.rand(1, 22, 1, generator=generator))
        turns[:, 0, 2] += 1.5 * time[:, 0, 0]
        rotations.append(quaternion_from_matrix(matrix_from_rotvec(turns)))
        angle = 1.5 * time[:, 0]
        hips.append(torch.cat([torch.cos(angle), torch.sin(angle), 0.9 + 0 * angle], -1))
        betas.append(torch.randn(1, 10, generator=generator).expand(length, -1))
    n = clips * length
    gender = torch.arange(n) // length % 2
    places, turned, shapes = torch.cat(hips), torch.cat(rotations), torch.cat(betas)
    return Frames(
        markers=skin_frames(places, turned, shapes, gender, load_marker_bodies()),
        hips=places,
        hips_rotation=matrix_from_quaternion(turned[:, 0]),
        rotations=turned,
        run=torch.arange(length, 0, -1).repeat(clips),
        weight=torch.ones(n),
        betas=shapes,
        gender=gender,
        acted=torch.zeros(n, dtype=torch.bool),
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
