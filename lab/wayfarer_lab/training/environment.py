"""The world that policies are trained in: many agents on a floor, each with a goal (Sec. 3.3.1).

An agent is a row; a step is one motion primitive of every row, on the same `PrimitiveStep` that
serves. Functions of state: the state goes in, the next one comes out.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor

from wayfarer.motion.frame import canonical_frame, to_local
from wayfarer.motion.obstacles import no_obstacles
from wayfarer.motion.policy import Condition
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.motion.quality import Candidate
from wayfarer.spec import MANNER
from wayfarer.terms import TERMS, WALK, weights
from wayfarer_lab.training import reward
from wayfarer_lab.training.dataset import random_betas
from wayfarer_lab.training.pose_networks import PosePrior, VPoser
from wayfarer_lab.training.rotation import matrix_from_quaternion, quaternion_from_matrix
from wayfarer_lab.training.starts import SeedPoses, StartSampler, about_z

HIPS_HEIGHT = (0.45, 1.4)
"""Metres: lower, the body lies or has sunk; higher, it flies."""
MAX_TILT = 1 - math.cos(math.radians(60))
"""`Candidate.tilt` of a trunk that has fallen over."""


class AgentBatch(NamedTuple):
    """Agents between two primitives. World, metres."""

    markers: Tensor  # [A, S, 67, 3]
    translation: Tensor  # [A, S, 3]
    rotations: Tensor  # [A, S, 22, 4]
    gender: Tensor  # [A] index into `spec.GENDERS`
    betas: Tensor  # [A, 10]
    goal: Tensor  # [A, 3]
    target_speed: Tensor  # [A]
    facing: Tensor  # [A, 2]
    term_weights: Tensor  # [A, T]


class State(NamedTuple):
    """Observations of the policy: canonical frame of each agent."""

    seed: Tensor  # [A, S, 201]
    condition: Condition


class Feedback(NamedTuple):
    """What one primitive brought."""

    rewards: Tensor  # [A, R - 1] all of `reward.REWARDS` but the goal's; 0 of broken bodies
    distance: Tensor  # [A] metres from hips to goal at the end, horizontal
    broken: Tensor  # [A] the body fell, sank, flew or is not finite
    hips: Tensor  # [A, 3] at the end


class Task(BaseModel):
    """What agents are asked to do. Metres, m/s."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    area: float = 20.0  # side of the square in whose middle they start
    reached: float = 0.75
    speeds: tuple[float, float] = (0.6, 1.6)
    near_share: float = 0.0  # of the goals within `near` of the start; uniform goals are rarely so
    near: float = 2.0


class GoalEnvironment:
    """Agents of both genders; `steps` are in the order of `spec.GENDERS`."""

    def __init__(
        self,
        steps: tuple[PrimitiveStep, ...],
        prior: PosePrior | VPoser,
        starts: StartSampler,
        task: Task,
        lead: tuple[PrimitiveStep, ...] = (),
    ) -> None:
        """With `lead`, starts are of one frame, and these steps make the first primitive."""
        self.steps = steps
        self.lead = lead
        self.prior = prior
        self.starts = starts
        self.task = task
        self.walk = torch.tensor(weights(WALK))

    @torch.no_grad()
    def reset(self, starts: int, clones: int) -> AgentBatch:
        """`starts` bodies at random, each with its goal, `clones` times over: [starts · clones].

        Gender, shape, pose, heading, goal and target speed are drawn (Sec. 3.3.1).
        """
        gender = torch.randint(len(self.steps), (starts,))
        betas = random_betas(starts)
        start = self.starts.draw(starts)
        turn = about_z(2 * math.pi * torch.rand(starts))
        hips = start.hips @ turn.transpose(-1, -2)
        rotations = start.rotations.clone()
        rotations[:, :, 0] = turn[:, None] @ rotations[:, :, 0]
        markers, translation = self._on_floor(SeedPoses(hips, rotations), gender, betas)
        slowest, fastest = self.task.speeds
        agents = AgentBatch(
            markers=markers,
            translation=translation,
            rotations=quaternion_from_matrix(rotations),
            gender=gender,
            betas=betas,
            goal=self._goals(starts),
            target_speed=slowest + (fastest - slowest) * torch.rand(starts),
            facing=torch.zeros(starts, 2),
            term_weights=self.walk.expand(starts, len(TERMS)),
        )
        return take(agents, torch.arange(starts).repeat_interleave(clones))

    def _goals(self, count: int) -> Tensor:
        """Goals [N, 3] on the floor: uniform over the area, or over a ring around the start."""
        anywhere = (torch.rand(count, 2) - 0.5) * self.task.area
        least, most = self.task.reached, self.task.near
        radius = torch.sqrt(least**2 + (most**2 - least**2) * torch.rand(count))
        angle = 2 * math.pi * torch.rand(count)
        close = radius[:, None] * torch.stack([torch.cos(angle), torch.sin(angle)], -1)
        near = torch.rand(count, 1) < self.task.near_share
        return torch.cat([torch.where(near, close, anywhere), torch.zeros(count, 1)], -1)

    def _on_floor(self, start: SeedPoses, gender: Tensor, betas: Tensor) -> tuple[Tensor, Tensor]:
        """Markers [N, S, 67, 3] and hips [N, S, 3], the lowest sole of all frames at z = 0."""
        parts = []
        for rows, step in self._by_gender(gender, self.steps):
            shape = step.body.shaped(betas[rows])
            markers, _ = step.body.skin(shape, start.hips[rows], start.rotations[rows])
            soles = markers[:, :, step.sites.left_sole + step.sites.right_sole, 2]
            up = -soles.amin((1, 2))[:, None, None] * torch.tensor([0.0, 0.0, 1.0])
            parts.append((rows, (markers + up[:, :, None], start.hips[rows] + up)))
        markers, translation = _reunited(parts)
        return markers, translation

    def _by_gender(
        self, gender: Tensor, steps: Sequence[PrimitiveStep]
    ) -> list[tuple[Tensor, PrimitiveStep]]:
        """Rows of each gender that occurs, and its step."""
        split = [(torch.nonzero(gender == g).squeeze(-1), s) for g, s in enumerate(steps)]
        return [(rows, step) for rows, step in split if len(rows)]

    def observe(self, agents: AgentBatch) -> State:
        """Seeds and what is asked, in the canonical frame of each agent."""
        turn = matrix_from_quaternion(agents.rotations[:, 0, 0])
        frame = canonical_frame(agents.translation[:, 0], turn, self.steps[0].floor_origin)
        seed = to_local(frame, agents.markers.flatten(1, 2)).reshape(*agents.markers.shape[:2], -1)
        condition = Condition(
            goal=to_local(frame, agents.goal[:, None])[:, 0],
            target_speed=agents.target_speed,
            facing=(agents.facing[:, None] @ frame.rotation[:, :2, :2])[:, 0],
            term_weights=agents.term_weights,
            manner=torch.zeros(len(seed), MANNER),  # the paper's policy has none
        )
        return State(seed, condition)

    @torch.no_grad()
    def step(self, agents: AgentBatch, latents: Tensor) -> tuple[AgentBatch, Feedback]:
        """One primitive of every agent by its latent [A, 128], whichever way that was chosen."""
        steps = self.lead if self.lead and agents.markers.shape[1] == 1 else self.steps
        parts = [
            (rows, self._step(step, take(agents, rows), latents[rows]))
            for rows, step in self._by_gender(agents.gender, steps)
        ]
        after = AgentBatch(*_reunited([(rows, both[0]) for rows, both in parts]))
        return after, Feedback(*_reunited([(rows, both[1]) for rows, both in parts]))

    def _step(
        self, step: PrimitiveStep, agents: AgentBatch, latents: Tensor
    ) -> tuple[AgentBatch, Feedback]:
        """The same for agents of one gender."""
        result = step(
            seed_markers=agents.markers,
            seed_translation=agents.translation,
            seed_rotations=agents.rotations,
            betas=agents.betas,
            goal=agents.goal,
            target_speed=agents.target_speed,
            facing=agents.facing,
            term_weights=agents.term_weights,
            policy=torch.zeros(len(latents)),  # with one candidate, the latent is the noise itself
            noise=latents[:, None],
            manner=torch.zeros(len(latents), MANNER),
            obstacles=no_obstacles(len(latents)),
        )
        outcome = self._outcome(step, agents, result.translation, result.rotations)
        keep = self.steps[0].predictor.seed_frames
        seed = result.next_seed_markers
        if seed.shape[1] < keep:  # the lead hands on one frame: the others are the body's own
            seed = torch.cat([outcome.body.markers[:, -keep : -seed.shape[1]], seed], 1)
        after = agents._replace(
            markers=seed,
            translation=result.translation[:, -keep:],
            rotations=result.rotations[:, -keep:],
        )
        return after, feedback_of(outcome)

    def _outcome(
        self, step: PrimitiveStep, agents: AgentBatch, translation: Tensor, rotations: Tensor
    ) -> reward.PrimitiveOutcome:
        """The body over seed and new frames: translation [A, F, 3], rotations [A, F, 22, 4]."""
        keep = agents.translation.shape[1]
        hips = torch.cat([agents.translation, translation], 1)
        local = matrix_from_quaternion(torch.cat([agents.rotations, rotations], 1))
        markers, _ = step.body.skin(step.body.shaped(agents.betas), hips, local)
        body = Candidate(
            markers=markers[:, keep - 1 :],
            velocity=markers[:, keep - 1] - markers[:, max(keep - 2, 0)],
            goal=agents.goal,
            target_speed=agents.target_speed,
            wished_facing=agents.facing,
            obstacles=no_obstacles(len(hips)),
            sites=step.sites,
        )
        pose = self.prior.encode(local[:, keep:, 1:]).mean
        return reward.PrimitiveOutcome(body, hips[:, keep - 1 :], pose)


def feedback_of(outcome: reward.PrimitiveOutcome) -> Feedback:
    """Rewards of a primitive, and whether the body is broken: fallen, sunk or not finite."""
    rewards = reward.evaluate(outcome)
    hips = outcome.hips[:, -1]
    low, high = HIPS_HEIGHT
    # a comparison with NaN is false, so what is not finite is not sound either
    sound = (hips[:, 2] > low) & (hips[:, 2] < high) & (outcome.body.tilt() < MAX_TILT)
    sound &= torch.isfinite(rewards).all(-1) & torch.isfinite(hips).all(-1)
    distance = (outcome.body.goal[:, :2] - hips[:, :2]).norm(dim=-1)
    return Feedback(torch.where(sound[:, None], rewards, 0.0), distance, ~sound, hips)


def take(agents: AgentBatch, rows: Tensor) -> AgentBatch:
    """Some agents, by index or mask."""
    return AgentBatch(*(field[rows] for field in agents))


def _reunited(parts: Sequence[tuple[Tensor, tuple[Tensor, ...]]]) -> list[Tensor]:
    """Fields of groups of rows, put together in the order of the rows."""
    order = torch.argsort(torch.cat([rows for rows, _ in parts]))
    return [torch.cat(fields)[order] for fields in zip(*(f for _, f in parts), strict=True)]
