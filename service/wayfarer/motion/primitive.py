"""PrimitiveStep: one motion primitive for a batch of agents, world in, world out.

The recursion of paper Sec. 3.3 in order: canonicalise the seed → predict K candidates → score them
by named quality terms → choose → regress the body → join it to the seed → skin its markers → set
it on the floor → blend predicted and reprojected markers → back to the world. It is exported whole
as one graph, so training, search and serving run the same code. Noise, goal and shape are inputs:
no state, no chance.
"""

from typing import NamedTuple

import torch
from torch import Tensor, nn

from wayfarer.motion.frame import canonical_frame, to_local, to_world
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.quality import Candidate, Sites, evaluate, foot_contacts
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.motion.rotation import (
    matrix_from_6d,
    matrix_from_quaternion,
    quaternion_from_matrix,
    sixd_from_matrix,
)

BLEND = 0.5
"""Share of reprojected markers in the next seed. With 0, predicted markers part from the body."""

GROUNDING = 0.5
"""Share of a primitive's height error that is taken off by its end (not in the paper)."""


class StepResult(NamedTuple):
    """Outputs; see `runtime.engine.StepOutputs` for shapes and units."""

    translation: Tensor
    rotations: Tensor
    contacts: Tensor
    next_seed_markers: Tensor
    terms: Tensor
    choice: Tensor


class PrimitiveStep(nn.Module):
    """One gender's step with the 2-frame predictor."""

    def __init__(
        self,
        predictor: MarkerPredictor,
        regressor: BodyRegressor,
        body: MarkerBody,
        sites: Sites,
        floor_origin: bool = True,
    ) -> None:
        super().__init__()
        self.predictor = predictor
        self.regressor = regressor
        self.body = body
        self.sites = sites
        self.floor_origin = floor_origin

    def forward(
        self,
        seed_markers: Tensor,  # [A, S, 67, 3]
        seed_translation: Tensor,  # [A, S, 3]
        seed_rotations: Tensor,  # [A, S, 22, 4]
        betas: Tensor,  # [A, 10]
        goal: Tensor,  # [A, 3]
        target_speed: Tensor,  # [A]
        term_weights: Tensor,  # [A, T]
        noise: Tensor,  # [A, K, 128]
    ) -> StepResult:
        """Step every row; rows do not influence each other."""
        seed_rotation = matrix_from_quaternion(seed_rotations[:, -1])
        first_turn = matrix_from_quaternion(seed_rotations[:, 0, 0])
        frame = canonical_frame(seed_translation[:, 0], first_turn, self.floor_origin)
        seed = to_local(frame, seed_markers.flatten(1, 2)).unflatten(1, seed_markers.shape[1:3])
        local_goal = to_local(frame, goal[:, None])[:, 0]

        futures = self.predictor.decode(seed.flatten(2), noise).unflatten(-1, (-1, 3))
        terms, choice = self._choose(
            seed, futures, local_goal, target_speed, term_weights, frame.origin
        )
        rows = torch.arange(choice.shape[0], device=choice.device)
        future, terms = futures[rows, choice], terms[rows, choice]

        translation, rotations = self._body(
            seed,
            future,
            betas,
            frame.rotation,
            seed_rotation,
            to_local(frame, seed_translation[:, -1:]),
        )
        shapes = betas[:, None].expand(-1, future.shape[1], -1)
        reprojected, _ = self.body(translation, rotations, shapes)
        lift = self._ground(reprojected + self._floor(frame.origin)[:, None, None])
        translation, reprojected = translation + lift, reprojected + lift[:, :, None]
        future = future + lift[:, :, None]
        blended = BLEND * reprojected + (1 - BLEND) * future

        soles = torch.cat([seed[:, -1:], reprojected], 1) + self._floor(frame.origin)[:, None, None]
        feet = torch.stack(
            [soles[:, :, self.sites.left_sole], soles[:, :, self.sites.right_sole]], 2
        )
        keep = seed.shape[1]
        next_seed = to_world(frame, blended[:, -keep:].flatten(1, 2)).unflatten(1, (keep, -1))
        world_root = frame.rotation[:, None] @ rotations[:, :, 0]
        world_rotations = torch.cat([world_root[:, :, None], rotations[:, :, 1:]], 2)
        return StepResult(
            translation=to_world(frame, translation),
            rotations=quaternion_from_matrix(world_rotations),
            contacts=foot_contacts(feet),
            next_seed_markers=next_seed,
            terms=terms,
            choice=choice,
        )

    def _ground(self, markers: Tensor) -> Tensor:
        """Shift [A, F, 3] that brings the lowest sole of a primitive [A, F, M, 3] to the floor.

        It grows from nothing at the seam, and the next seed carries it on, so nothing jumps; over
        a few primitives a body can neither sink nor float. Within 0.2 s even a runner touches down.
        """
        soles = markers[:, :, self.sites.left_sole + self.sites.right_sole, 2]
        ramp = _ease(markers.shape[1], markers)
        up = markers.new_tensor([0.0, 0.0, 1.0])
        return -GROUNDING * soles.amin((1, 2))[:, None, None] * ramp[:, None] * up

    def _floor(self, origin: Tensor) -> Tensor:
        """What to add to local points so that the floor is z = 0 (nothing with a floor origin)."""
        return origin * origin.new_tensor([0.0, 0.0, 1.0])

    def _choose(
        self,
        seed: Tensor,
        futures: Tensor,
        goal: Tensor,
        speed: Tensor,
        weights: Tensor,
        origin: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Terms of all candidates [A, K, T] and the cheapest one's index [A] (Sec. 3.3.2)."""
        candidates = futures.shape[1]
        last = seed[:, None, -1:].expand(-1, candidates, -1, -1, -1)
        markers = torch.cat([last, futures], 2) + self._floor(origin)[:, None, None, None]
        candidate = Candidate(
            markers, goal[:, None].expand(-1, candidates, -1), speed[:, None], self.sites
        )
        terms = evaluate(candidate)
        cost = (terms * weights[:, None]).sum(-1)
        return terms, cost.argmin(-1)

    def _body(
        self,
        seed: Tensor,
        future: Tensor,
        betas: Tensor,
        turn: Tensor,
        seed_rotation: Tensor,
        seed_place: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Hips [A, F, 3] and rotations [A, F, 22, 3, 3] of the new frames, canonical frame.

        The regressor also sees the last seed frame, whose pose is known. Its error there is taken
        off the new frames, fading out over the primitive, so poses do not jump at the seam (the
        role of GAMMA's `_blend_params`).
        """
        frames = torch.cat([seed[:, -1:], future], 1)
        shapes = betas[:, None].expand(-1, frames.shape[1], -1)
        place, rotation = self.regressor(frames, shapes)
        sixd = sixd_from_matrix(rotation)
        known_root = turn.transpose(-1, -2) @ seed_rotation[:, 0]
        known = sixd_from_matrix(torch.cat([known_root[:, None], seed_rotation[:, 1:]], 1))
        fade = 1 - _ease(future.shape[1], seed)
        place = place[:, 1:] + fade[:, None] * (seed_place - place[:, :1])
        sixd = sixd[:, 1:] + fade[:, None, None] * (known[:, None] - sixd[:, :1])
        return place, matrix_from_6d(sixd)


def _ease(frames: int, like: Tensor) -> Tensor:
    """Rise from 0 (the last seed frame, left out) to 1 (the last new frame), flat at both ends."""
    t = torch.linspace(0, 1, frames + 1, device=like.device)[1:]
    return 0.5 - 0.5 * torch.cos(torch.pi * t)
