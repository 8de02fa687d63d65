"""The motions that the paper's pictures show (Fig. 4, S1, S2): made once, kept as JSON.

Only a motion's joint places are kept, to the millimetre, so that a picture can be drawn again
without the models.
"""

from collections.abc import Mapping
from typing import Any, Final, TypedDict

import numpy as np
import torch
from numpy.typing import NDArray

from wayfarer.body.library import load_body
from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.models.bundle import ModelBundle
from wayfarer.spec import BETAS, FPS, LATENT, NEW_FRAMES, POSED_JOINTS
from wayfarer.world.goals.steering import Steering
from wayfarer.world.search.beam import grow
from wayfarer.world.search.beam_settings import BeamSettings
from wayfarer.world.search.problem import PlanningProblem
from wayfarer.world.stepping.mirror import has_mirror_image
from wayfarer_lab.evaluation.control import random_pairs
from wayfarer_lab.evaluation.model_parts import Parts, Variant
from wayfarer_lab.evaluation.outcome import NEAR, REACHED, STEP_LIMIT
from wayfarer_lab.evaluation.rollout import (
    FrozenPoses,
    Rollout,
    Seed,
    advance,
    ahead,
    always,
    roll_out,
)

Array = NDArray[np.floating[Any]]
Places = list[list[list[float]]]
"""Joints [frames][22][3], metres, world."""

SHOWN: Final = 6
"""Primitives that Fig. S1 shows of each seed."""
SHAPES: Final = (-6.0, -2.0, 2.0, 6.0)
"""Standard deviations along the first two components: the four bodies of Fig. S2."""
POSES: Final = 3
EVERY: Final = round(0.8 * FPS)
"""Frames between two bodies of a walk in a picture."""


class DrawnMotion(TypedDict):
    """One body's motion in a picture."""

    name: str
    joints: Places
    goal: list[float] | None  # x, y
    reached: bool


class Seeded(TypedDict):
    """A row of Fig. S1: a seed, and the last frames of primitives that begin with it."""

    name: str
    seed: Places
    ends: Places


class Figures(TypedDict):
    """All that is drawn."""

    fig_4: list[DrawnMotion]
    fig_s1: list[Seeded]
    fig_s2: list[DrawnMotion]


def joints_of(body: BodyModel, betas: Array, hips: Array, rotations: Array) -> Array:
    """Places [F, 22, 3] of poses: hips [F, 3], rotations [F, 22, 4]."""
    local = matrix_from_quaternion(np.asarray(rotations, np.float64))
    rest = body.rest_joints(np.asarray(betas, np.float64))
    return body.forward_kinematics(np.asarray(hips, np.float64), local, rest)[1][:, :POSED_JOINTS]


@torch.inference_mode()
def seeded_primitives(parts: Parts, seed: int) -> list[Seeded]:
    """Fig. S1: of one walking body, six primitives by each predictor, with the same latents."""
    variant = _walker(parts)
    rest = _upright("female", torch.zeros(1, BETAS))
    walked = roll_out(
        parts,
        variant,
        rest,
        2 * FPS,
        _random(seed),
        always(ahead(rest)) if variant.policy else None,
    )
    body = load_body("anny52", rest.gender, "low")
    noise = torch.randn(SHOWN, 1, LATENT, generator=_random(seed + 1))
    rows: list[Seeded] = []
    for name in parts.predictors:
        step = parts.step(rest.gender, Variant(name, name))
        frames = step.predictor.seed_frames
        given = _last(walked, frames)
        every = Seed(*(part.expand(SHOWN, *part.shape[1:]) for part in given))
        many = FrozenPoses(
            rest.gender, rest.rotations.expand(SHOWN, -1, -1), rest.betas.expand(SHOWN, -1)
        )
        made = advance(step, every, many, noise, None)
        shape = rest.betas[0].numpy()
        rows.append(
            Seeded(
                name=name,
                seed=_places(joints_of(body, shape, given[1][0].numpy(), given[2][0].numpy())),
                ends=_places(
                    joints_of(
                        body, shape, made.translation[:, -1].numpy(), made.rotations[:, -1].numpy()
                    )
                ),
            )
        )
    return rows


@torch.inference_mode()
def corner_cases(parts: Parts, starts: FrozenPoses, seed: int) -> list[DrawnMotion]:
    """Fig. S2: four shapes from one pose, then the mean shape from three of `starts`.

    All walk to a goal 5 m ahead, for at most 60 primitives; empty when there is no policy.
    """
    variant = _walker(parts)
    if not variant.policy:
        return []
    cases = [(f"{size:+g} sd", starts.rotations[0], size) for size in SHAPES]
    cases += [(f"pose {k + 1}", starts.rotations[k], 0.0) for k in range(1, POSES + 1)]
    betas = torch.zeros(len(cases), BETAS)
    betas[:, :2] = torch.tensor([size for *_, size in cases])[:, None]
    poses = FrozenPoses(starts.gender, torch.stack([turn for _, turn, _ in cases]), betas)
    goals = ahead(poses)
    made = roll_out(parts, variant, poses, STEP_LIMIT * NEW_FRAMES, _random(seed), always(goals))
    body, found = load_body("anny52", poses.gender, "low"), list[DrawnMotion]()
    for row, (name, *_) in enumerate(cases):
        goal = goals[row, :2].numpy()
        joints = joints_of(body, betas[row].numpy(), made.hips[row], made.rotations[row])
        found.append(_walk(name, joints, goal))
    return found


def methods(bundles: Mapping[str, tuple[ModelBundle, float]], seed: int) -> list[DrawnMotion]:
    """Fig. 4: the same body on its way to the same goal, by method, without a search.

    `bundles`: name → model and share of its policy (0: none). Shown is the clone that arrived
    first, or that came nearest.
    """
    found: list[DrawnMotion] = []
    (pair,) = random_pairs(1, 1.2, np.random.default_rng(seed))
    for name, (bundle, share) in bundles.items():
        world = bundle.world(1, Steering())
        settings = BeamSettings.paper(policy=share, reach=NEAR)
        problem = PlanningProblem.of(
            [pair.spec],
            world.prepare([pair.spec]),
            [[pair.goal]],
            mirrors=has_mirror_image(bundle.bodies.values()),
        )
        (tree,) = grow(bundle.engine, problem, settings)
        plan = tree.plan(int(np.argmin(tree.distances)))
        body = bundle.bodies[pair.spec.gender]
        betas = np.array(pair.spec.betas)
        joints = joints_of(body, betas, plan.translation, plan.rotations)
        found.append(_walk(name, joints, np.array(pair.goal.position[:2])))
    return found


def _walk(name: str, joints: Array, goal: Array) -> DrawnMotion:
    """Bodies at every `EVERY` frames until the goal is reached; the last frame is one of them."""
    near = np.flatnonzero(np.linalg.norm(joints[:, 0, :2] - goal, axis=-1) <= REACHED)
    end = int(near[0]) if len(near) else len(joints) - 1
    frames = sorted({*range(0, end, EVERY), end})
    return DrawnMotion(
        name=name,
        joints=_places(joints[frames]),
        goal=[round(float(x), 3) for x in goal],
        reached=bool(len(near)),
    )


def _walker(parts: Parts) -> Variant:
    """The 2-frame predictor with the policy, if there is one."""
    name = next(n for n in ("ro-2f", "2f") if n in parts.predictors)
    return Variant("walker", name, policy=parts.policy is not None)


def _upright(gender: str, betas: torch.Tensor) -> FrozenPoses:
    still = torch.zeros(len(betas), POSED_JOINTS, 4)
    still[..., 3] = 1
    return FrozenPoses(gender, still, betas)


def _last(made: Rollout, frames: int) -> Seed:
    """The last frames of the first body, as the seed of a primitive."""
    return Seed(
        torch.from_numpy(made.markers[:1, -frames:]),
        torch.from_numpy(made.hips[:1, -frames:]),
        torch.from_numpy(made.rotations[:1, -frames:]),
    )


def _random(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def _places(joints: Array) -> Places:
    rounded: Places = np.round(joints, 3).tolist()
    return rounded
