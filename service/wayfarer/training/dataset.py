"""Prepared motion as tensors: frames in the world, windows in their canonical frame.

The predictor learns from windows of markers; the regressor from single poses, which can be
re-skinned with any body shape.
"""

from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from wayfarer.body.library import load_body
from wayfarer.body.model import BodyModel
from wayfarer.errors import InvalidArgument
from wayfarer.motion.frame import canonical_frame, to_local
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.rotation import matrix_from_quaternion
from wayfarer.spec import BETAS, GENDERS


def marker_body(body: BodyModel) -> MarkerBody:
    """The torch skinning of a body's markers."""
    chosen = body.marker_vertices
    return MarkerBody(
        parents=body.parents,
        bind_joints=body.bind_joints,
        bind_joints_dirs=body.bind_joints_dirs,
        bind_to_rest=body.bind_to_rest,
        bind_markers=body.bind_vertices[chosen],
        bind_markers_dirs=body.bind_vertices_dirs[chosen],
        skin_joints=body.skin_joints[chosen],
        skin_weights=body.skin_weights[chosen],
    )


@dataclass(frozen=True)
class Frames:
    """All frames of one split, end to end. Clip edges are respected by `starts`."""

    markers: Tensor  # [N, 67, 3] world
    hips: Tensor  # [N, 3]
    hips_rotation: Tensor  # [N, 3, 3]
    rotations: Tensor  # [N, 22, 4] local quaternions, joint 0 world
    run: Tensor  # [N] frames left in the unbroken stretch that begins here, itself included
    weight: Tensor  # [N] how often a window should start here, relative

    def starts(self, length: int) -> tuple[Tensor, Tensor]:
        """Frames where a window of `length` may start, and their weights."""
        index = torch.nonzero((self.run >= length) & (self.weight > 0)).squeeze(-1)
        if len(index) == 0:
            raise InvalidArgument(f"the data hold no unbroken stretch of {length} frames")
        return index, self.weight[index]

    def world(self, starts: Tensor, length: int) -> Tensor:
        """Windows in the world [B, length, 67, 3]."""
        return self.markers[starts[:, None] + torch.arange(length)]

    def canonical(self, starts: Tensor, length: int, floor_origin: bool) -> Tensor:
        """Windows [B, length, 201] in the canonical frame of their first frame."""
        frame = canonical_frame(self.hips[starts], self.hips_rotation[starts], floor_origin)
        windows = self.world(starts, length)
        return to_local(frame, windows.flatten(1, 2)).reshape(len(starts), length, -1)


class WindowSampler:
    """Draws start frames with replacement, in proportion to their weight."""

    def __init__(self, frames: Frames, length: int) -> None:
        self.index, weight = frames.starts(length)
        self._upto = torch.cumsum(weight.double(), 0)

    def draw(self, count: int, generator: torch.Generator | None = None) -> Tensor:
        """`count` start frames."""
        u = torch.rand(count, dtype=torch.float64, generator=generator) * self._upto[-1]
        return self.index[torch.searchsorted(self._upto, u).clamp(max=len(self.index) - 1)]


def skin_frames(
    hips: Tensor, rotations: Tensor, betas: Tensor, gender: Tensor, bodies: dict[str, MarkerBody]
) -> Tensor:
    """Markers [N, 67, 3] of frames whose body differs: gender [N] indexes `GENDERS`."""
    markers = torch.empty(len(hips), 67, 3)
    with torch.no_grad():
        for g, name in enumerate(GENDERS):
            for rows in torch.nonzero(gender == g).squeeze(-1).split(4096):
                local = matrix_from_quaternion(rotations[rows])
                markers[rows], _ = bodies[name](hips[rows], local, betas[rows])
    return markers


def load_marker_bodies(name: str = "anny52") -> dict[str, MarkerBody]:
    """Torch skinning of both genders."""
    return {g: marker_body(load_body(name, g)) for g in GENDERS}


def random_betas(count: int, scale: float = 1.0) -> Tensor:
    """Shapes drawn from the (unit variance) shape space, within 2.5 standard deviations."""
    return (torch.randn(count, BETAS) * scale).clamp(-2.5, 2.5)


def data_file(folder: Path) -> Path:
    """The prepared arrays in a folder. Raises InvalidArgument when there are none."""
    path = folder / "motion.npz"
    if not path.exists():
        raise InvalidArgument(f"{path} does not exist; make it with `wayfarer data prepare SRC {folder}`")
    return path
