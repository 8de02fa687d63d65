"""PrimitiveStep: one motion primitive for a batch of agents, world in, world out.

The recursion of paper Sec. 3.3 in order: canonicalise the seed → draw K latents from the prior or
the policy → predict K candidates → score them by named quality terms → choose → regress the body
→ join it to the seed → skin its markers → set it on the floor → blend predicted and reprojected
markers → back to the world. It is exported whole as one graph, so training, search and serving
run the same code. Noise, goal and shape are inputs: no state, no randomness.
"""

from collections.abc import Sequence
from math import prod
from typing import NamedTuple

import torch
from torch import Tensor, nn

from wayfarer.motion.constants import constant, indices, numbers
from wayfarer.motion.frame import Frame, canonical_frame, to_local, to_world
from wayfarer.motion.marker_body import MarkerBody, Placed, Shaped
from wayfarer.motion.obstacles import localised
from wayfarer.motion.policy import Condition, Policy
from wayfarer.motion.posing import (
    compose,
    from_6d,
    from_quaternion,
    to_6d,
    to_columns,
    to_quaternion,
    to_rows,
)
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.quality import Candidate, Sites, evaluate, foot_contacts, take
from wayfarer.motion.regressor import BodyRegressor, Pose

BLEND = 0.5
"""Share of reprojected markers in the next seed. With 0, predicted markers drift from the body."""

CARRY = 0.6
"""Share of the velocity's jump at a seam that continues and fades out (not in the paper)."""

GROUNDING = 0.5
"""Share of a primitive's height error that is removed by its end (not in the paper)."""

EVERY = 2
"""Stride of the frames that the regressor gets (in the paper it gets every one).

Frames between are interpolated, which makes the step a quarter cheaper."""


class Settled(NamedTuple):
    """A primitive as a body takes it; see `StepResult`."""

    translation: Tensor
    rotations: Tensor
    contacts: Tensor
    next_seed_markers: Tensor


class StepResult(NamedTuple):
    """Outputs; see `engines.engine.StepOutputs` for shapes and units."""

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
        policy: Policy | None = None,
        floor_origin: bool = True,
        blend: float = BLEND,
        grounding: float = GROUNDING,
        every: int = EVERY,
        soles: MarkerBody | None = None,
    ) -> None:
        """Without a policy, latents come from the prior N(0, I) whatever the condition is.

        `soles` skins the 8 points under the feet of a body whose markers have nothing there.
        """
        super().__init__()
        self.predictor = predictor
        self.regressor = regressor
        self.policy = policy
        self.body = body
        self.sites = sites
        self.floor_origin = floor_origin
        self.blend = blend
        self.grounding = grounding
        self.every = every
        self.soles = soles

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
        manner: Tensor,  # [A, 8]
        obstacles: Tensor,  # [A, O, 7]
    ) -> StepResult:
        """Steps every row; rows do not influence each other."""
        frame, known = self._begin(seed_translation, seed_rotations)
        seed = to_local(frame, seed_markers.flatten(1, 2)).unflatten(1, seed_markers.shape[1:3])
        asked = Condition(
            goal=to_local(frame, goal[:, None])[:, 0],
            target_speed=target_speed,
            facing=(facing[:, None] @ frame.rotation[:, :2, :2])[:, 0],
            term_weights=term_weights,
            manner=manner,
        )

        futures = self.predict(seed.flatten(2), asked, noise, policy).unflatten(-1, (-1, 3))
        terms, choice = self._choose(frame, seed, futures, asked, localised(frame, obstacles))
        future, terms = _chosen(futures, choice), _chosen(terms, choice)

        settled = self.settle(frame, seed, future, betas, seed_translation, known)
        return StepResult(*settled, terms=terms, choice=choice)

    def follow(
        self,
        seed_markers: Tensor,  # [A, S, 67, 3]
        seed_translation: Tensor,  # [A, S, 3]
        seed_rotations: Tensor,  # [A, S, 22, 4]
        betas: Tensor,  # [A, 10]
        future: Tensor,  # [A, F, 201] in the canonical frame of the seed
    ) -> Settled:
        """`forward` from the point at which the future markers are known."""
        frame, known = self._begin(seed_translation, seed_rotations)
        seed = to_local(frame, seed_markers.flatten(1, 2)).unflatten(1, seed_markers.shape[1:3])
        markers = future.unflatten(-1, (-1, 3))
        return self.settle(frame, seed, markers, betas, seed_translation, known)

    def _begin(self, translation: Tensor, rotations: Tensor) -> tuple[Frame, Tensor]:
        """The canonical frame of a seed, and its rotations as matrices [3, 3, 22, S, A]."""
        turns = to_columns(rotations).permute(2, 1, 0, 3)  # [4, 22, S, A]
        known = from_quaternion(turns)
        root = known[:, :, 0, 0].permute(2, 0, 1)
        return canonical_frame(translation[:, 0], root, self.floor_origin), known

    def predict(self, seed: Tensor, asked: Condition, noise: Tensor, share: Tensor) -> Tensor:
        """Candidate futures [A, K, F, 201] of a seed [A, S, 201]; share [A] of the policy."""
        latents = noise
        if self.policy is not None:
            latents = self.policy(seed, asked).sample(noise, share)
        return self.predictor.decode(seed, latents)

    def settle(
        self,
        frame: Frame,
        seed: Tensor,  # [A, S, 67, 3] canonical
        future: Tensor,  # [A, F, 67, 3] canonical
        betas: Tensor,  # [A, 10]
        seed_translation: Tensor,  # [A, S, 3] world
        known: Tensor,  # [3, 3, 22, S, A] the seed's rotations, joint 0 world
    ) -> Settled:
        """The body behind predicted markers, joined to the seed, on the floor, in the world."""
        shape = self.body.shaped(betas)
        to_frame = frame.rotation.permute(2, 1, 0)[:, :, None, None]  # [3, 3, 1, 1, A], transposed
        shown = Pose(
            to_columns(to_local(frame, seed_translation)).transpose(0, 1),
            torch.cat([compose(to_frame, known[:, :, :1]), known[:, :, 1:]], 2),
        )
        pose = self._body(seed, future, betas, shape, shown)
        joints = self.body.place(shape, pose.hips, pose.rotations)
        # [A, F, 8, 3], the left foot first
        soles = self._above(frame, self._under(betas, joints))
        lift = self._ground(soles)  # [A, F]
        soles = soles + lift[:, :, None, None] * _up(soles)
        if self.soles is None:
            before = self._above(frame, take(seed[:, -1:], self._feet()))
        else:
            last = self.body.place(shape, shown.hips[:, -1:], shown.rotations[..., -1:, :])
            before = self._above(frame, self._under(betas, last))

        keep = seed.shape[1]
        ends = Placed(joints.rotations[..., -keep:, :], joints.places[..., -keep:, :])
        reprojected = self.body.blend(shape, ends).transpose(-1, -2)
        blended = self.blend * reprojected + (1 - self.blend) * future[:, -keep:]
        blended = blended + lift[:, -keep:, None, None] * _up(lift)
        hips = to_rows(pose.hips.transpose(0, 1)) + lift[..., None] * _up(lift)
        root = compose(frame.rotation.permute(1, 2, 0)[:, :, None, None], pose.rotations[:, :, :1])
        turned = to_quaternion(torch.cat([root, pose.rotations[:, :, 1:]], 2))
        return Settled(
            translation=to_world(frame, hips),
            rotations=to_rows(turned.permute(2, 1, 0, 3)),
            contacts=foot_contacts(torch.cat([before, soles], 1).unflatten(2, (2, -1))),
            next_seed_markers=to_world(frame, blended.flatten(1, 2)).unflatten(1, (keep, -1)),
        )

    def _feet(self) -> list[int]:
        return self.sites.left_sole + self.sites.right_sole

    def _under(self, betas: Tensor, joints: Placed) -> Tensor:
        """Points under the feet [A, F, 8, 3] of bodies whose joints lie there."""
        if self.soles is None:
            feet = self.body.shaped(betas, self._feet())
        else:
            feet = self.soles.shaped(betas)
        return self.body.blend(feet, joints).transpose(-1, -2)

    def _ground(self, soles: Tensor) -> Tensor:
        """Metres [A, F] to raise frames by so that the lowest sole [A, F, 8, 3] meets the floor.

        It grows from nothing at the seam, and the next seed carries it on, so nothing jumps; over
        a few primitives a body can neither sink nor float. Within 0.2 s even a runner touches down.
        """
        lowest = soles[..., 2].amin((1, 2))[:, None]
        return -self.grounding * lowest * _ease(soles.shape[1], soles)

    def _above(self, frame: Frame, points: Tensor) -> Tensor:
        """Local points [A, ..., 3] with the floor at z = 0, where it is with a floor origin."""
        if self.floor_origin:
            return points
        floor = frame.origin * _up(points)
        return points + floor.view(-1, *(1,) * (points.dim() - 2), 3)

    def _choose(
        self, frame: Frame, seed: Tensor, futures: Tensor, asked: Condition, obstacles: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Terms of all candidates [A, K, T] and the cheapest one's index [A] (Sec. 3.3.2).

        A one-frame seed has no velocity: its body is taken to rest.
        """
        last = seed[:, None, -1:].expand(-1, futures.shape[1], -1, -1, -1)
        candidate = Candidate(
            markers=self._above(frame, torch.cat([last, futures], 2)),
            velocity=(seed[:, -1] - seed[:, max(seed.shape[1] - 2, 0)])[:, None],
            goal=asked.goal[:, None],
            target_speed=asked.target_speed[:, None],
            wished_facing=asked.facing[:, None],
            obstacles=obstacles[:, None],
            sites=self.sites,
        )
        terms = evaluate(candidate)
        cost = (terms * asked.term_weights[:, None]).sum(-1)
        return terms, cost.argmin(-1)

    def _body(
        self, seed: Tensor, future: Tensor, betas: Tensor, shape: Shaped, shown: Pose
    ) -> Pose:
        """Body parameters of the new frames, canonical frame. `shown` is the seed's pose.

        The regressor also sees the last seed frame. Its error there is subtracted from the new
        frames, fading out over the primitive, so poses do not jump at the seam (the role of GAMMA's
        `_blend_params`). Part of the remaining jump of velocity continues in the same way.
        """
        count = future.shape[1]
        knots = _knots(count, self.every)
        regressed = future.index_select(1, indices([k - 1 for k in knots[1:]], future))
        frames = torch.cat([seed[:, -1:], regressed], 1)
        found = self.regressor.solve(frames, betas, shape)
        states = torch.cat([_numbers(shown), _numbers(found)])  # [S + knots, 135, A]
        joining = constant(states, _joining, shown.hips.shape[1], tuple(knots), states.dtype)
        # One product for all: with the agents alone as columns, one agent would be multiplied by
        # another kernel than many, and differ in the last bit.
        joined = (joining @ states.flatten(1)).unflatten(1, states.shape[1:]).transpose(0, 1)
        return Pose(joined[:3], from_6d(joined[3:].unflatten(0, (6, -1))))


def _chosen(candidates: Tensor, choice: Tensor) -> Tensor:
    """The chosen candidate of each row of [A, K, ...], in one gather."""
    agents, count = candidates.shape[:2]
    rows = torch.arange(agents, device=choice.device) * count + choice
    return candidates.flatten(0, 1).index_select(0, rows)


def _numbers(pose: Pose) -> Tensor:
    """[F, 135, A]"""
    return torch.cat([pose.hips, to_6d(pose.rotations).flatten(0, 1)]).transpose(0, 1)


def _knots(count: int, every: int) -> list[int]:
    """Frames that are regressed: 0 (the last seed frame), every `every`-th, and the last."""
    return sorted({*range(0, count + 1, every), count})


def _joining(seeds: int, knots: Sequence[int], dtype: torch.dtype) -> Tensor:
    """Weights of new frames 1…F over the shown seed frames and the frames found at `knots`.

    [F, seeds + knots]: found + fade · (shown - found at the last seed frame), and `CARRY` of the
    jump of velocity. Frames between knots are interpolated through the four nearest.
    """
    count = knots[-1]
    t = torch.arange(1, count + 1, dtype=torch.float64)
    found = torch.cat([torch.zeros(count, seeds), _interpolation(knots)[1:]], 1)
    start, last = torch.zeros(seeds + len(knots)), torch.zeros(seeds + len(knots))
    last[seeds - 1], start[seeds] = 1, 1
    fade = 1 - _ease(count, t)[:, None]
    joined = found + fade * (last - start)
    if seeds > 1:
        before = torch.zeros_like(last)
        before[seeds - 2] = 1
        jump = (last - before) - (joined[0] - last)
        joined = joined + (CARRY * t * (1 - t / count) ** 2)[:, None] * jump
    return joined.to(dtype)


def _interpolation(knots: Sequence[int]) -> Tensor:
    """Values at frames 0…F from those at the knots: cubic, through the four nearest. [F + 1, K]"""
    rows = torch.zeros(knots[-1] + 1, len(knots), dtype=torch.float64)
    for frame in range(knots[-1] + 1):
        near = sorted(range(len(knots)), key=lambda k: abs(knots[k] - frame))[:4]
        for k in near:
            others = [knots[o] for o in near if o != k]
            rows[frame, k] = prod((frame - o) / (knots[k] - o) for o in others)
    return rows


def _ease(frames: int, like: Tensor) -> Tensor:
    """Rise from 0 (the last seed frame, left out) to 1 (the last new frame), flat at both ends."""
    t = torch.linspace(0, 1, frames + 1, dtype=like.dtype, device=like.device)[1:]
    return 0.5 - 0.5 * torch.cos(torch.pi * t)


def _up(like: Tensor) -> Tensor:
    return numbers((0.0, 0.0, 1.0), like)
