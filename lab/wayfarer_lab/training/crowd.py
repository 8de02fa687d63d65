"""Bodies of one gender in training: drawn from recorded motion, stepped, replaced if broken."""

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.primitive import StepResult
from wayfarer.spec import FPS, LATENT, MANNER, SEED_FRAMES
from wayfarer_lab.training.dataset import Frames, WindowSampler, random_betas
from wayfarer_lab.training.rotation import matrix_from_quaternion

LOW_HIPS = 0.5
"""Metres: lower hips have fallen."""

TILTED = 0.7
"""Cosine of the angle between the hips' up axis and the vertical below which a body has fallen."""


@dataclass
class TrainingCrowd:
    """Where A agents stand between two steps, world space."""

    markers: Tensor  # [A, S, 67, 3]
    translation: Tensor  # [A, S, 3]
    rotations: Tensor  # [A, S, 22, 4]
    betas: Tensor  # [A, 10]
    manner: Tensor  # [A, 8]
    own: Tensor  # [A, 128] noise that an agent keeps for good, as in the service

    @property
    def place(self) -> Tensor:
        """Hips on the ground plane, last frame [A, 2]."""
        return self.translation[:, -1, :2]

    @property
    def speed(self) -> Tensor:
        """Horizontal m/s of the hips, last two frames [A]."""
        return (self.translation[:, -1, :2] - self.translation[:, -2, :2]).norm(dim=-1) * FPS

    @property
    def facing(self) -> Tensor:
        """Horizontal unit vector that the hips face, last frame [A, 2]."""
        forward = matrix_from_quaternion(self.rotations[:, -1, 0])[:, :2, 1]
        return forward / forward.norm(dim=-1, keepdim=True).clamp(min=1e-6)

    def put(self, rows: Tensor, other: "TrainingCrowd") -> None:
        """Replaces some agents."""
        for column in fields(self):
            getattr(self, column.name)[rows] = getattr(other, column.name)

    def detached(self) -> "TrainingCrowd":
        """The same, cut off from the graph that made it."""
        return TrainingCrowd(**{c.name: getattr(self, c.name).detach() for c in fields(self)})

    def after(self, result: StepResult) -> "TrainingCrowd":
        """Where a step leaves the agents."""
        seed = self.markers.shape[1]
        return TrainingCrowd(
            markers=result.next_seed_markers,
            translation=result.translation[:, -seed:],
            rotations=result.rotations[:, -seed:],
            betas=self.betas,
            manner=self.manner,
            own=self.own,
        )

    def broken(self) -> Tensor:
        """Agents [A] that are not finite, have fallen or exploded."""
        markers, hips = self.markers.detach().flatten(1, 2), self.translation[:, -1].detach()
        up = matrix_from_quaternion(self.rotations[:, -1, 0].detach())[:, 2, 2]
        extent = (markers - hips[:, None]).norm(dim=-1).amax(-1)
        sound = (hips[:, 2] > LOW_HIPS) & (up > TILTED) & (extent < 2.0)
        return ~(sound & markers.isfinite().all(-1).all(-1))


class CrowdSampler:
    """Draws agents in the midst of recorded motion, on bodies of random shapes."""

    def __init__(self, frames: Frames, body: MarkerBody) -> None:
        self.frames, self.body = frames, body
        self.sampler = WindowSampler(frames, SEED_FRAMES)
        # the soles decide how high a body of another shape stands
        self.soles = frames.markers[..., 2].amin(-1)

    @torch.no_grad()
    def draw(self, count: int) -> TrainingCrowd:
        """`count` agents whose first frame lies over the origin, facing as recorded."""
        rows = self.sampler.draw(count)[:, None] + torch.arange(SEED_FRAMES)
        betas = random_betas(count)
        hips, rotations = self.frames.hips[rows].clone(), self.frames.rotations[rows]
        hips[..., :2] -= hips[:, :1, :2].clone()
        local = matrix_from_quaternion(rotations)
        markers, _ = self.body.skin(self.body.shaped(betas), hips, local)
        recorded = self.soles[rows].amin(-1)
        lift = recorded - markers[..., 2].amin((-1, -2))
        up = lift[:, None, None] * torch.tensor([0.0, 0.0, 1.0])
        manner = torch.randn(count, MANNER)
        own = torch.randn(count, LATENT)
        return TrainingCrowd(markers + up[:, None], hips + up, rotations, betas, manner, own)
