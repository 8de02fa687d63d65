"""Open rollouts: primitive after primitive, one latent each, without search (paper Sec. 4.1).

Bodies begin frozen in a pose. As in GAMMA, a 2-frame model gets its first seed from a primitive of
the 1-frame model, where there is one; that *lead-in* is not measured, for any model.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from wayfarer.errors import InvalidArgument
from wayfarer.models.bundle import START_POSES
from wayfarer.motion.marker_body import MarkerBody, Shaped
from wayfarer.motion.obstacles import no_obstacles
from wayfarer.motion.primitive import PrimitiveStep, StepResult
from wayfarer.motion.quality import Sites
from wayfarer.spec import BETAS, GENDERS, LATENT, MANNER
from wayfarer.terms import WALK, weights
from wayfarer.world.agents.spawn import load_start_poses
from wayfarer_lab.evaluation.model_parts import Parts, Variant
from wayfarer_lab.evaluation.outcome import REACHED
from wayfarer_lab.evaluation.tracks import BodyTrack, Recorded
from wayfarer_lab.training.pose_networks import LATENT as PRIOR_LATENT
from wayfarer_lab.training.pose_networks import PosePrior
from wayfarer_lab.training.rotation import matrix_from_quaternion, quaternion_from_matrix

Array = NDArray[np.floating[Any]]

WALKING_SPEED: Final = 1.2
"""Target speed of the policy, m/s."""

AREA: Final = 10.0
"""Metres from the start on either axis within which random goals lie (20 × 20 m, Sec. 4.2)."""

TARGET: Final = 5.0
"""Metres ahead of a start pose."""

EXTENT: Final = 3.0
"""Metres from the hips to a marker beyond which it is no body any more."""

Goals = Callable[[Tensor], Tensor]
"""Places of the hips [A, 2] → goals [A, 3]; called before every primitive."""


@dataclass(frozen=True)
class FrozenPoses:
    """A bodies of one gender, each frozen in a pose."""

    gender: str
    rotations: Tensor  # [A, 22, 4]
    betas: Tensor  # [A, 10]


class Seed(NamedTuple):
    """S frames that a primitive begins with."""

    markers: Tensor  # [A, S, 67, 3]
    translation: Tensor  # [A, S, 3]
    rotations: Tensor  # [A, S, 22, 4]


@dataclass(frozen=True)
class Rollout:
    """A bodies of one gender over T frames, and what went from primitive to primitive."""

    markers: Array  # [A, T, 67, 3] of the skinned bodies, world
    hips: Array  # [A, T, 3]
    rotations: Array  # [A, T, 22, 4]
    carried: Array  # [A, P, S, 67, 3] markers of each next seed
    seam_every: int  # frames; a seam lies before frame 0 and before each of its multiples

    def sound(self) -> "Rollout":
        """Only the sound bodies: finite, every marker within 3 m of the hips."""
        reach = np.linalg.norm(self.markers - self.hips[:, :, None], axis=-1).max((-2, -1))
        rows = reach < EXTENT  # a NaN fails
        return Rollout(
            self.markers[rows],
            self.hips[rows],
            self.rotations[rows],
            self.carried[rows],
            self.seam_every,
        )

    def tracks(self) -> list[BodyTrack]:
        """Body by body."""
        motions = zip(self.markers, self.hips, self.rotations, strict=True)
        return [BodyTrack(*body) for body in motions]

    def reprojected(self) -> Array:
        """Markers of the bodies at the frames of `carried` [A, P, S, 67, 3]."""
        bodies, primitives, frames = self.carried.shape[:3]
        cut = self.markers.reshape(bodies, primitives, self.seam_every, *self.markers.shape[2:])
        return cut[:, :, -frames:]


def recorded_poses(
    recorded: Recorded, count: int, random: np.random.Generator
) -> list[FrozenPoses]:
    """`count` random frames in use, half of them of each gender, in the recorded shapes."""
    chosen = []
    for gender, number in _halves(count):
        clips = [c for c in recorded.clips if c.gender == gender]
        rows = [c.start + np.flatnonzero(recorded.data.use[c.start : c.stop]) for c in clips]
        frames = np.concatenate([np.zeros(0, np.int64), *rows])
        if not len(frames):
            raise InvalidArgument(f"the split has no frames of {gender} bodies in use")
        shapes = np.repeat([c.betas for c in clips], [len(r) for r in rows], axis=0)
        picked = random.choice(len(frames), number, replace=len(frames) < number)
        turns = recorded.data.rotations[frames[picked]]
        chosen.append(_poses(gender, turns, shapes[picked]))
    return chosen


def standing_poses(count: int, random: np.random.Generator) -> list[FrozenPoses]:
    """`count` of the shipped start poses, half of each gender, in random shapes (σ 1, ≤ 2.5)."""
    known = load_start_poses(START_POSES)
    return [
        _poses(
            gender,
            known[random.integers(len(known), size=number)],
            random.standard_normal((number, BETAS)).clip(-2.5, 2.5),
        )
        for gender, number in _halves(count)
    ]


@torch.inference_mode()
def prior_poses(prior: PosePrior, count: int, random: np.random.Generator) -> list[FrozenPoses]:
    """`count` upright bodies in poses drawn from the pose prior, half of each gender, mean shape.

    The paper's choice (Sec. A.2, 3.3.1). Not every such pose is one in which a person could stand.
    """
    chosen = []
    for gender, number in _halves(count):
        latents = torch.from_numpy(
            random.standard_normal((number, PRIOR_LATENT)).astype(np.float32)
        )
        body = quaternion_from_matrix(prior.decode(latents))
        upright = torch.tensor([0.0, 0.0, 0.0, 1.0]).expand(number, 1, 4)
        chosen.append(
            _poses(gender, torch.cat([upright, body], 1).numpy(), np.zeros((number, BETAS)))
        )
    return chosen


def random_goals(count: int, random: np.random.Generator) -> Goals:
    """Each body's goal anywhere in 20 × 20 m; another one when it is reached (0.75 m)."""

    def draw(rows: int) -> Tensor:
        return torch.from_numpy(random.uniform(-AREA, AREA, (rows, 2)).astype(np.float32))

    places = draw(count)

    def goals(hips: Tensor) -> Tensor:
        reached = (places - hips).norm(dim=-1) < REACHED
        places[reached] = draw(int(reached.sum()))
        return torch.cat([places, torch.zeros(count, 1)], -1)

    return goals


@torch.no_grad()  # no inference mode: a step may optimise
def roll_out(
    parts: Parts,
    variant: Variant,
    poses: FrozenPoses,
    frames: int,
    random: torch.Generator,
    goals: Goals | None = None,
) -> Rollout:
    """Generates whole primitives that cover `frames` frames, after the lead-in.

    `goals` are for variants with a policy; the others draw latents from N(0, I) and know none.
    """
    step = parts.step(poses.gender, variant)
    shape, keep = step.body.shaped(poses.betas), step.predictor.seed_frames
    lead = _lead(parts, variant, poses.gender) or step
    still = frozen(step.body, step.sites, poses)
    seed = Seed(*(part.repeat_interleave(lead.predictor.seed_frames, 1) for part in still))
    result = advance(lead, seed, poses, _noise(poses, random), goals)
    markers = result.next_seed_markers
    if len(markers[0]) != keep:  # a 1-frame primitive hands on one frame only
        markers = _skin(step, shape, result)[:, -keep:]
    seed = _seed(markers, result)

    every = step.predictor.new_frames
    bodies, hips, turns, carried = [], [], [], []
    for _ in range(-(-frames // every)):
        result = advance(step, seed, poses, _noise(poses, random), goals)
        seed = _seed(result.next_seed_markers, result)
        bodies.append(_skin(step, shape, result))
        hips.append(result.translation)
        turns.append(result.rotations)
        carried.append(seed.markers)
    return Rollout(
        markers=torch.cat(bodies, 1).numpy(),
        hips=torch.cat(hips, 1).numpy(),
        rotations=torch.cat(turns, 1).numpy(),
        carried=torch.stack(carried, 1).numpy(),
        seam_every=every,
    )


def _lead(parts: Parts, variant: Variant, gender: str) -> PrimitiveStep | None:
    """The 1-frame step of the same training, without a policy; None where there is none."""
    name = variant.predictor.replace("2f", "1f")
    if name not in parts.predictors:
        return None
    return parts.step(gender, replace(variant, predictor=name, policy=False))


def frozen(body: MarkerBody, sites: Sites, poses: FrozenPoses) -> Seed:
    """One frame: hips over the origin, the lowest sole marker on the floor."""
    rotations = poses.rotations[:, None]
    places = torch.zeros(len(rotations), 1, 3)
    local = matrix_from_quaternion(rotations)
    markers, _ = body.skin(body.shaped(poses.betas), places, local)
    soles = sites.left_sole + sites.right_sole
    lift = -markers[:, :, soles, 2].amin(-1)[..., None] * torch.tensor([0.0, 0.0, 1.0])
    return Seed(markers + lift[:, :, None], places + lift, rotations)


def ahead(poses: FrozenPoses) -> Tensor:
    """Points [A, 3] on the floor, 5 m in front of bodies that stand at the origin."""
    right = matrix_from_quaternion(poses.rotations[:, 0])[:, :2, 0]
    right = right / right.norm(dim=-1, keepdim=True)
    return TARGET * torch.stack([-right[:, 1], right[:, 0], torch.zeros(len(right))], -1)


def always(goals: Tensor) -> Goals:
    """The same goals [A, 3] all the way."""
    return lambda hips: goals


def advance(
    step: PrimitiveStep, seed: Seed, poses: FrozenPoses, noise: Tensor, goals: Goals | None
) -> StepResult:
    """One primitive of each body, its latent from `noise` [A, K, 128]."""
    count = len(poses.betas)
    hips = seed.translation[:, -1, :2]
    result: StepResult = step(
        seed_markers=seed.markers,
        seed_translation=seed.translation,
        seed_rotations=seed.rotations,
        betas=poses.betas,
        goal=torch.zeros(count, 3) if goals is None else goals(hips),
        target_speed=torch.full((count,), WALKING_SPEED),
        facing=torch.zeros(count, 2),
        term_weights=torch.tensor(weights(WALK)).expand(count, -1),
        policy=torch.ones(count),  # counts only where the step has one
        noise=noise,
        manner=torch.zeros(count, MANNER),
        obstacles=no_obstacles(count),
    )
    return result


def _noise(poses: FrozenPoses, random: torch.Generator) -> Tensor:
    return torch.randn(len(poses.betas), 1, LATENT, generator=random)


def _seed(markers: Tensor, result: StepResult) -> Seed:
    keep = markers.shape[1]
    return Seed(markers, result.translation[:, -keep:], result.rotations[:, -keep:])


def _skin(step: PrimitiveStep, shape: Shaped, result: StepResult) -> Tensor:
    """Markers [A, F, 67, 3] of the bodies of a step."""
    local = matrix_from_quaternion(result.rotations)
    return step.body.skin(shape, result.translation, local)[0]


def _poses(gender: str, rotations: Array, betas: Array) -> FrozenPoses:
    return FrozenPoses(
        gender,
        torch.from_numpy(np.asarray(rotations, np.float32)),
        torch.from_numpy(np.asarray(betas, np.float32)),
    )


def _halves(count: int) -> list[tuple[str, int]]:
    """Both genders' shares of `count`; none is empty when `count` is 2 or more."""
    return [(GENDERS[0], count - count // 2), (GENDERS[1], count // 2)]
