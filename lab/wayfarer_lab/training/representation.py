"""Representations of a primitive's frames: markers, or body parameters (paper, Sec. A.4).

The marker predictor's network stays the same; only its frames are other numbers. Whatever they are,
training looks at the markers of the bodies they stand for: directly, or by kinematics and skinning,
since body parameters learned as such "can hardly produce valid results" (Sec. A.4).

Features are [B, F, size] in the canonical frame of their seed. Lengths are metres, velocities
metres or radians per second; a frame's velocity is that from the frame before (of a window's first
frame: to the next). Deviation from the paper: rotations are 6D, not axis and angle, as in all our
networks; so nothing wraps around.
"""

from typing import Final, Literal, NamedTuple

import torch
from torch import Tensor

from wayfarer.engines.torch.marker_bodies import load_marker_bodies
from wayfarer.motion.frame import Frame, to_local, to_world
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.spec import FPS, GENDERS, MARKERS, POSED_JOINTS
from wayfarer_lab.training.dataset import Frames, by_gender
from wayfarer_lab.training.rotation import (
    matrix_from_6d,
    matrix_from_quaternion,
    rotvec_from_matrix,
    sixd_from_matrix,
)

Name = Literal["markers", "body", "humor"]


class Whose(NamedTuple):
    """The bodies of B rows."""

    betas: Tensor  # [B, 10]
    gender: Tensor  # [B] index in `GENDERS`

    @classmethod
    def of(cls, frames: Frames, rows: Tensor) -> "Whose":
        """Those of frames `rows` [B]."""
        return cls(frames.betas[rows], frames.gender[rows])


class Told(NamedTuple):
    """Recorded motion."""

    features: Tensor  # [B, F, size]
    markers: Tensor  # [B, F, 201] the same frame of reference


class Beside(NamedTuple):
    """Features that the markers do not depend on; nothing else would teach them."""

    places: Tensor  # [B, F, N] metres
    velocities: Tensor  # [B, F, M] per second


class Markers:
    """The paper's choice: 67 markers, flat."""

    size: int = 3 * MARKERS

    def recorded(self, frames: Frames, index: Tensor, frame: Frame) -> Told:
        """Features of the frames `index` [B, F], each row an unbroken stretch."""
        markers = to_local(frame, frames.markers[index].flatten(1, 2))
        flat = markers.reshape(*index.shape, -1)
        return Told(flat, flat)

    def markers(self, features: Tensor, whose: Whose) -> Tensor:
        """Markers [B, F, 201] of the bodies that features stand for. Differentiable."""
        return features

    def beside(self, features: Tensor) -> Beside | None:
        """Features that must be learned in addition to the markers."""
        return None

    def handed_on(self, features: Tensor, markers: Tensor) -> Tensor:
        """The part of a prediction with which the next primitive of a rollout begins."""
        return features

    def moved(self, features: Tensor, before: Frame, after: Frame) -> Tensor:
        """Features of one canonical frame in another one."""
        points = features.reshape(len(features), -1, 3)
        return to_local(after, to_world(before, points)).reshape(features.shape)


class BodyParameters(Markers):
    """*SMPL params*: the hips' place r, their orientation Φ, and the joints' rotations θ, 6D."""

    size = 3 + 6 * POSED_JOINTS

    def __init__(self) -> None:
        bodies = load_marker_bodies()
        self.bodies = [bodies[gender] for gender in GENDERS]

    def recorded(self, frames: Frames, index: Tensor, frame: Frame) -> Told:
        """As `Markers.recorded`."""
        rotations = matrix_from_quaternion(frames.rotations[index])
        root = frame.rotation.transpose(-1, -2)[:, None] @ rotations[:, :, 0]
        rotations = torch.cat([root[:, :, None], rotations[:, :, 1:]], 2)
        hips = to_local(frame, frames.hips[index])
        told = self.features(hips, rotations, Whose.of(frames, index[:, 0]))
        return Told(told, super().recorded(frames, index, frame).markers)

    def features(self, hips: Tensor, rotations: Tensor, whose: Whose) -> Tensor:
        """Features of poses in their canonical frame: hips [B, F, 3], rotations
        [B, F, 22, 3, 3].
        """
        return torch.cat([hips, sixd_from_matrix(rotations).flatten(2)], -1)

    def pose(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Hips [B, F, 3] and rotations [B, F, 22, 3, 3], canonical frame."""
        turns = features[..., 3 : BodyParameters.size].unflatten(-1, (POSED_JOINTS, 6))
        return features[..., :3], matrix_from_6d(turns)

    def markers(self, features: Tensor, whose: Whose) -> Tensor:
        """As `Markers.markers`, by kinematics and skinning."""
        return self.skin(*self.pose(features), whose)[0].flatten(2)

    def skin(self, hips: Tensor, rotations: Tensor, whose: Whose) -> tuple[Tensor, ...]:
        """Markers [B, F, 67, 3] and joints [B, F, 22, 3] of poses as `pose` gives them."""

        def of_gender(body: MarkerBody, rows: Tensor) -> tuple[Tensor, Tensor]:
            return body.skin(body.shaped(whose.betas[rows]), hips[rows], rotations[rows])

        return by_gender(whose.gender, self.bodies, of_gender)

    def moved(self, features: Tensor, before: Frame, after: Frame) -> Tensor:
        """As `Markers.moved`."""
        hips = to_local(after, to_world(before, features[..., :3]))
        root = _turned(features[..., 3:9], before, after)
        return torch.cat([hips, root, features[..., 9:]], -1)


class HumorFeatures(BodyParameters):
    """*HuMoR primitive*: r, Φ, θ, then ṙ, Φ̇, the joints' places J and their velocities J̇.

    r, Φ and θ define the bodies; the rest is learned in addition.
    """

    size = BodyParameters.size + 6 + 6 * POSED_JOINTS

    def features(self, hips: Tensor, rotations: Tensor, whose: Whose) -> Tensor:
        """As `BodyParameters.features`."""
        joints = self.skin(hips, rotations, whose)[1].flatten(2)
        turn = rotations[:, 1:, 0] @ rotations[:, :-1, 0].transpose(-1, -2)
        spin = FPS * rotvec_from_matrix(turn)
        return torch.cat(
            [
                super().features(hips, rotations, whose),
                _velocity(hips),
                torch.cat([spin[:, :1], spin], 1),
                joints,
                _velocity(joints),
            ],
            -1,
        )

    def beside(self, features: Tensor) -> Beside:
        """Joints; the velocities of hips and joints and the spin of the hips."""
        rest = features[..., BodyParameters.size :]
        joints = rest[..., 6 : 6 + 3 * POSED_JOINTS]
        velocities = torch.cat([rest[..., :6], rest[..., 6 + 3 * POSED_JOINTS :]], -1)
        return Beside(joints, velocities)

    def moved(self, features: Tensor, before: Frame, after: Frame) -> Tensor:
        """As `Markers.moved`."""
        pose = features[..., : BodyParameters.size]
        places, velocities = self.beside(features)
        places = Markers.moved(self, places, before, after)
        velocities = _turned(velocities, before, after)
        moved = [velocities[..., :6], places, velocities[..., 6:]]
        return torch.cat([super().moved(pose, before, after), *moved], -1)


REPRESENTATIONS: Final[dict[Name, type[Markers]]] = {
    "markers": Markers,
    "body": BodyParameters,
    "humor": HumorFeatures,
}


def _velocity(places: Tensor) -> Tensor:
    """Velocity [B, F, N] from the frame before; in the first frame, to the next one."""
    step = FPS * (places[:, 1:] - places[:, :-1])
    return torch.cat([step[:, :1], step], 1)


def _turned(vectors: Tensor, before: Frame, after: Frame) -> Tensor:
    """Directions [B, F, 3 N] of one canonical frame in another one."""
    turn = before.rotation.transpose(-1, -2) @ after.rotation  # of row vectors
    return (vectors.reshape(len(vectors), -1, 3) @ turn).reshape(vectors.shape)
