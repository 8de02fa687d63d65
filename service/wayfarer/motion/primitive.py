"""PrimitiveStep: one motion primitive for a batch of agents, world in, world out.

The recursion of paper Sec. 3.3 in order: canonicalise the seed → draw K latents from the prior or
the policy → predict K candidates → score them by named quality terms → choose → regress the body
→ join it to the seed → skin its markers → set it on the floor → blend predicted and reprojected
markers → back to the world. It is exported whole as one graph, so training, search and serving
run the same code. Noise, goal and shape are inputs: no state, no chance.
"""

from typing import NamedTuple

import torch
from torch import Tensor, nn

from wayfarer.motion.frame import canonical_frame, to_local, to_world
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.policy import Condition, GoalPolicy
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

CARRY = 0.4
"""Share of the jump of velocity at a seam that is carried on and fades out (not in the paper)."""

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
        policy: GoalPolicy | None = None,
        floor_origin: bool = True,
        blend: float = BLEND,
        grounding: float = GROUNDING,
    ) -> None:
        """Without a policy, latents come from the prior N(0, I) whatever the step is told."""
        super().__init__()
        self.predictor = predictor
        self.regressor = regressor
        self.policy = policy
        self.body = body
        self.sites = sites
        self.floor_origin = floor_origin
        self.blend = blend
        self.grounding = grounding

    def forward(
        self,
        seed_markers: Tensor,  # [A, S, 67, 3]
        seed_translation: Tensor,  # [A, S, 3]
        seed_rotations: Tensor,  # [A, S, 22, 4]
        betas: Tensor,  # [A, 10]
        goal: Tensor,  # [A, 3]
        target_speed: Tensor,  # [A]
        facing: Tensor,  # [A, 2]
        term_weights: Tensor,  # [A, T]
        policy: Tensor,  # [A]
        noise: Tensor,  # [A, K, 128]
    ) -> StepResult:
        """Step every row; rows do not influence each other."""
        seed_local = matrix_from_quaternion(seed_rotations)
        first_turn = seed_local[:, 0, 0]
        frame = canonical_frame(seed_translation[:, 0], first_turn, self.floor_origin)
        seed = to_local(frame, seed_markers.flatten(1, 2)).unflatten(1, seed_markers.shape[1:3])
        asked = Condition(
            goal=to_local(frame, goal[:, None])[:, 0],
            target_speed=target_speed,
            facing=(facing[:, None] @ frame.rotation[:, :2, :2])[:, 0],
            term_weights=term_weights,
        )

        futures = self.predict(seed.flatten(2), asked, noise, policy).unflatten(-1, (-1, 3))
        terms, choice = self._choose(seed, futures, asked, frame.origin)
        rows = torch.arange(choice.shape[0], device=choice.device)
        future, terms = futures[rows, choice], terms[rows, choice]

        known_root = frame.rotation.transpose(-1, -2)[:, None] @ seed_local[:, :, 0]
        known = torch.cat([known_root[:, :, None], seed_local[:, :, 1:]], 2)
        translation, rotations = self._body(
            seed, future, betas, to_local(frame, seed_translation), known
        )
        reprojected, _ = self.body.skin(self.body.shaped(betas), translation, rotations)
        lift = self._ground(reprojected + self._floor(frame.origin)[:, None, None])
        translation, reprojected = translation + lift, reprojected + lift[:, :, None]
        future = future + lift[:, :, None]
        blended = self.blend * reprojected + (1 - self.blend) * future

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

    def predict(self, seed: Tensor, asked: Condition, noise: Tensor, share: Tensor) -> Tensor:
        """Candidate futures [A, K, F, 201] of a seed [A, S, 201]; share [A]: of the policy."""
        latents = noise
        if self.policy is not None:
            latents = self.policy(seed, asked).sample(noise, share)
        return self.predictor.decode(seed, latents)

    def _ground(self, markers: Tensor) -> Tensor:
        """Shift [A, F, 3] that brings the lowest sole of a primitive [A, F, M, 3] to the floor.

        It grows from nothing at the seam, and the next seed carries it on, so nothing jumps; over
        a few primitives a body can neither sink nor float. Within 0.2 s even a runner touches down.
        """
        soles = markers[:, :, self.sites.left_sole + self.sites.right_sole, 2]
        ramp = _ease(markers.shape[1], markers)
        up = markers.new_tensor([0.0, 0.0, 1.0])
        return -self.grounding * soles.amin((1, 2))[:, None, None] * ramp[:, None] * up

    def _floor(self, origin: Tensor) -> Tensor:
        """What to add to local points so that the floor is z = 0 (nothing with a floor origin)."""
        return origin * origin.new_tensor([0.0, 0.0, 1.0])

    def _choose(
        self, seed: Tensor, futures: Tensor, asked: Condition, origin: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Terms of all candidates [A, K, T] and the cheapest one's index [A] (Sec. 3.3.2)."""
        terms = evaluate(candidates_of(seed, futures, asked, self._floor(origin), self.sites))
        cost = (terms * asked.term_weights[:, None]).sum(-1)
        return terms, cost.argmin(-1)

    def _body(
        self, seed: Tensor, future: Tensor, betas: Tensor, known_place: Tensor, known: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Hips [A, F, 3] and rotations [A, F, 22, 3, 3] of the new frames, canonical frame.

        Seed place [A, S, 3] and rotations `known` [A, S, 22, 3, 3] are what was shown. The
        regressor also sees the last seed frame. Its error there is taken off the new frames, fading
        out over the primitive, so poses do not jump at the seam (the role of GAMMA's
        `_blend_params`); of the jump of velocity that is left, a part is carried on likewise.
        """
        frames = torch.cat([seed[:, -1:], future], 1)
        found_place, found = self.regressor(frames, betas)
        shown = torch.cat([known_place, sixd_from_matrix(known).flatten(2)], -1)
        states = torch.cat([found_place, sixd_from_matrix(found).flatten(2)], -1)
        last = shown[:, -1:]
        count = future.shape[1]
        fade = 1 - _ease(count, seed)[:, None]
        states = states[:, 1:] + fade * (last - states[:, :1])
        if shown.shape[1] > 1:
            jump = (last - shown[:, -2:-1]) - (states[:, :1] - last)
            t = torch.arange(1, count + 1, dtype=seed.dtype, device=seed.device)[:, None]
            states = states + CARRY * t * (1 - t / count) ** 2 * jump
        return states[..., :3], matrix_from_6d(states[..., 3:].unflatten(-1, (-1, 6)))


def candidates_of(
    seed: Tensor, futures: Tensor, asked: Condition, floor: Tensor, sites: Sites
) -> Candidate:
    """Candidates [A, K] for the quality terms: seed [A, S, 67, 3], futures [A, K, F, 67, 3].

    `floor` [A, 3] is added to all points so that the floor is z = 0. A one-frame seed has no
    velocity: its body is taken to rest.
    """
    count = futures.shape[1]
    last = seed[:, None, -1:].expand(-1, count, -1, -1, -1)
    velocity = (seed[:, -1] - seed[:, max(seed.shape[1] - 2, 0)])[:, None]
    return Candidate(
        markers=torch.cat([last, futures], 2) + floor[:, None, None, None],
        velocity=velocity,
        goal=asked.goal[:, None],
        target_speed=asked.target_speed[:, None],
        wished_facing=asked.facing[:, None],
        sites=sites,
    )


def _ease(frames: int, like: Tensor) -> Tensor:
    """Rise from 0 (the last seed frame, left out) to 1 (the last new frame), flat at both ends."""
    t = torch.linspace(0, 1, frames + 1, device=like.device)[1:]
    return 0.5 - 0.5 * torch.cos(torch.pi * t)
