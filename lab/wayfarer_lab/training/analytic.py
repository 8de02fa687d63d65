"""Train the policy by analytic gradients: the quality terms of a few steps, differentiated.

Search asks which of K latents brings the least weighted sum of quality terms. The terms are
differentiable functions of the latent, so a policy can learn the answer directly: every step of
every agent tells it the slope in all 128 dimensions, where PPO (`training/policy.py`, the paper's
way) learns one number from it. PPO may go on from here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor, nn

from wayfarer.body.library import load_body
from wayfarer.marker_bodies import marker_body
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.obstacles import no_obstacles
from wayfarer.motion.policy import Condition, Gaussian, GoalPolicy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.primitive import BLEND, PrimitiveStep
from wayfarer.motion.quality import Sites
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import GENDERS, LATENT
from wayfarer.terms import TERMS
from wayfarer_lab.training.crowd import Crowd, CrowdSampler
from wayfarer_lab.training.dataset import Frames
from wayfarer_lab.training.rotation import matrix_from_quaternion
from wayfarer_lab.training.run import TrainingRun, cosine_rate, load_weights
from wayfarer_lab.training.tasks import STANDING, STRAFING, TURNING, WALKING, Tasks, draw_tasks


class AnalyticConfig(BaseModel):
    """What a policy is trained with; files in `training/configs/`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    predictor: str = "runs/predictor_2f_rollout"
    regressors: dict[str, str] = {g: f"runs/regressor_{g}" for g in GENDERS}
    steps: int = 3000
    agents: int = 384  # of each gender, stepped in turn
    horizon: int = 3  # steps through which gradients flow
    rate: float = 5e-4
    kl_weight: float = 1.0  # of KL(π ‖ p) per latent dimension, p the predictor's prior
    strain_weight: float = 1.0  # of crouching and of knees beyond their limits, see `Posture`
    body_weight: float = 60.0  # of a metre by which predicted markers miss the body, see `off_body`
    renewal: float = 0.01  # chance at every step that an agent is replaced by a new one
    start_from: str = ""  # run folder of a policy to go on from
    mix: dict[str, float] = {
        "walk": 0.35,
        "run": 0.05,
        "start_stop": 0.25,
        "turn": 0.15,
        "standing": 0.2,
    }  # where new agents begin, see dataset.group_of
    seed: int = 0


FALL = 20.0
"""What a fall costs: as much as the dearest step."""

LOW_WAIST = 0.92
"""Share of the waist's height in the T-pose below which a body crouches."""

BENT, STRAIGHT = radians(115), radians(-3)
"""Knees bend no farther than this, and not beyond straight."""


@dataclass(frozen=True)
class Posture:
    """What no quality term of the service looks at: crouching, and knees beyond their limits."""

    waist: list[int]
    hips: list[int]  # left, right
    knees: list[tuple[int, int]]  # of each side the marker on its left, and on its right
    ankles: list[int]

    @classmethod
    def from_names(cls, names: Sequence[str]) -> "Posture":
        """Of a body's markers."""
        at = {name: i for i, name in enumerate(names)}
        return cls(
            waist=[at[n] for n in ("LFWT", "LBWT", "RFWT", "RBWT")],
            hips=[at["LHIP"], at["RHIP"]],
            knees=[(at["LKNE"], at["LKNI"]), (at["RKNI"], at["RKNE"])],
            ankles=[at["LANK"], at["RANK"]],
        )

    def strain(self, markers: Tensor, resting: Tensor) -> Tensor:
        """Cost [A] of poses [A, 67, 3] of bodies whose T-pose is `resting` [A, 3, 67].

        5 cm of crouching cost 1, and so do 30 degrees beyond a knee's limits.
        """
        height = resting[:, 2, self.waist].mean(-1) - resting[:, 2].amin(-1)
        crouching = (LOW_WAIST * height - markers[:, self.waist, 2].mean(-1)).clamp(min=0)
        beyond = torch.zeros_like(crouching)
        for hip, (left, right), ankle in zip(self.hips, self.knees, self.ankles, strict=True):
            knee = (markers[:, left] + markers[:, right]) / 2
            thigh, shin = knee - markers[:, hip], markers[:, ankle] - knee
            axis = torch.nn.functional.normalize(markers[:, right] - markers[:, left], dim=-1)
            sine = -(torch.cross(thigh, shin, dim=-1) * axis).sum(-1)
            flexion = torch.atan2(sine, (thigh * shin).sum(-1))
            beyond = beyond + (flexion - BENT).clamp(min=0) + (STRAIGHT - flexion).clamp(min=0)
        return 20 * crouching + 2 * beyond


LOOSE = 0.015
"""Metres by which predicted markers may miss the body's: the prior's own miss it by 1.2 cm."""


def off_body(after: Crowd, body: MarkerBody) -> Tensor:
    """Mean distance [A], metres, from the last predicted markers to those of the body behind them.

    The terms look at predicted markers, and people see the body. Without a price on what lies
    between, a policy finds latents whose markers are no body's (soles on the floor, the body 8 cm
    above it). The slope is that of the markers: the body is taken as it is.
    """
    with torch.no_grad():
        rotations = matrix_from_quaternion(after.rotations)
        skin, _ = body.skin(body.shaped(after.betas), after.translation, rotations)
    # the next seed lies `BLEND` of the way from the predicted markers to the body's
    return (after.markers - skin).norm(dim=-1).mean((-1, -2)) / (1 - BLEND)


class Watched(nn.Module):
    """The policy inside a step, whose last distribution can be read."""

    def __init__(self, policy: GoalPolicy) -> None:
        super().__init__()
        self.policy = policy
        self.last: Gaussian | None = None

    def forward(self, seed: Tensor, condition: Condition) -> Gaussian:
        """As the policy's."""
        self.last = self.policy(seed, condition)
        return self.last


class AnalyticTrainer:
    """Two crowds, one per gender, that never stop; every update continues one of them."""

    def __init__(self, config: AnalyticConfig, train: Frames, validation: Frames) -> None:
        torch.manual_seed(config.seed)
        self.config = config
        self.policy = GoalPolicy()
        if config.start_from:
            load_weights(self.policy, Path(config.start_from)).train()
        self.watched = Watched(self.policy)
        self.posture = Posture.from_names(load_body("anny52", GENDERS[0]).marker_names)
        self.steps = {g: self._step(g) for g in GENDERS}
        self.samplers = {g: CrowdSampler(train, s.body) for g, s in self.steps.items()}
        self.trials = {g: CrowdSampler(validation, s.body) for g, s in self.steps.items()}
        self.crowds = {g: s.draw(config.agents) for g, s in self.samplers.items()}
        self.tasks = {g: draw_tasks(c.place, c.facing) for g, c in self.crowds.items()}
        self.optimizer = torch.optim.Adam(self.policy.parameters(), lr=config.rate, fused=True)
        self.run: TrainingRun | None = None

    def _step(self, gender: str) -> PrimitiveStep:
        model = load_body("anny52", gender)
        body: MarkerBody = marker_body(model)
        predictor = load_weights(MarkerPredictor(2), Path(self.config.predictor))
        regressor = load_weights(BodyRegressor(body), Path(self.config.regressors[gender]))
        sites = Sites.from_names(model.marker_names)
        for network in (predictor, regressor):
            network.requires_grad_(False)
        # matrix products in bfloat16; skinning and terms stay in float32
        half = torch.autocast("cpu", dtype=torch.bfloat16)
        predictor.decode = half(predictor.decode)  # type: ignore[method-assign]
        regressor.know = half(regressor.know)  # type: ignore[method-assign]
        regressor.correct = half(regressor.correct)  # type: ignore[method-assign]
        # No slope flows through the bodies: the terms are of the predicted markers.
        regressor.solve = torch.no_grad()(regressor.solve)  # type: ignore[method-assign]
        return PrimitiveStep(predictor, regressor, body, sites, self.watched)  # type: ignore[arg-type]

    def advance(
        self, gender: str, crowd: Crowd, tasks: Tasks
    ) -> tuple[Crowd, Tensor, Tensor, Gaussian]:
        """One step of a crowd: where it leaves them, cost [A], terms [A, T], π."""
        count, weight = len(crowd.betas), tasks.term_weights()
        result = self.steps[gender](
            crowd.markers,
            crowd.translation.detach(),
            crowd.rotations.detach(),
            crowd.betas,
            tasks.goal,
            tasks.target_speed(crowd.place.detach(), crowd.speed.detach()),
            tasks.wished_facing(crowd.facing.detach()),
            weight,
            torch.ones(count),
            torch.randn(count, 1, LATENT),
            no_obstacles(count),
        )
        assert self.watched.last is not None
        cost = (result.terms * weight).sum(-1)
        after, body = crowd.after(result), self.steps[gender].body
        strain = self.posture.strain(after.markers[:, -1], body.resting(crowd.betas))
        cost = cost + self.config.strain_weight * strain
        cost = cost + self.config.body_weight * (off_body(after, body) - LOOSE).clamp(min=0)
        return after, cost, result.terms, self.watched.last

    def update(self) -> dict[str, float]:
        """One optimiser step."""
        assert self.run is not None
        config, gender = self.config, GENDERS[self.run.step % len(GENDERS)]
        for group in self.optimizer.param_groups:
            group["lr"] = cosine_rate(config.rate, self.run.step, config.steps)
        crowd, tasks = self.crowds[gender], self.tasks[gender]
        total, divergence = torch.zeros(()), torch.zeros(())
        sound = torch.ones(config.agents)
        for _ in range(config.horizon):
            crowd, cost, _, distribution = self.advance(gender, crowd, tasks)
            # a cost is worth no more than a fall's: slopes of freak bodies would drown the rest
            cost = FALL * torch.tanh(cost.nan_to_num(FALL) / FALL)
            cost = torch.where(crowd.broken(), FALL, cost)
            total = total + (sound * cost).mean() / config.horizon
            sound = sound * (~crowd.broken()).float()  # what follows a fall teaches nothing
            divergence = divergence + distribution.kl().mean() / config.horizon
        self.optimizer.zero_grad()
        (total + config.kl_weight * divergence).backward()
        norm = torch.nn.utils.clip_grad_norm_(self.policy.parameters(), 1.0)
        if norm.isfinite():
            self.optimizer.step()
        self._go_on(gender, crowd.detached(), tasks)
        return {
            "cost": float(total.detach()),
            "kl": float(divergence.detach()),
            "fallen": float(1 - sound.mean()),
        }

    def _go_on(self, gender: str, crowd: Crowd, tasks: Tasks) -> None:
        """Renew tasks; replace broken agents, and some others, by new ones."""
        tasks.renew(crowd.place, crowd.facing)
        leave = crowd.broken() | (torch.rand(self.config.agents) < self.config.renewal)
        rows = torch.nonzero(leave).squeeze(-1)
        if len(rows):
            crowd.put(rows, self.samplers[gender].draw(len(rows)))
            tasks.put(rows, draw_tasks(crowd.place[rows], crowd.facing[rows]))
        self.crowds[gender] = crowd

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Mean terms of 20 steps from validation seeds, by kind of task."""
        state = torch.get_rng_state()
        torch.manual_seed(1)
        sums = torch.zeros(len(KINDS), len(TERMS))
        counts = torch.zeros(len(KINDS), 1)
        fallen = 0.0
        for gender, sampler in self.trials.items():
            crowd = sampler.draw(self.config.agents // 2)
            tasks = draw_tasks(crowd.place, crowd.facing)
            for _ in range(20):
                crowd, _, terms, _ = self.advance(gender, crowd, tasks)
                for kind in KINDS:
                    of_kind = terms[tasks.kind == kind].nan_to_num()
                    sums[kind] += of_kind.sum(0)
                    counts[kind] += len(of_kind)
                tasks.renew(crowd.place, crowd.facing)
            fallen += float(crowd.broken().float().mean()) / len(self.trials)
        torch.set_rng_state(state)
        found = {"val/fallen": fallen}
        means = (sums / counts.clamp(min=1)).tolist()
        for kind, name in KINDS.items():
            found |= {f"val/{name}_{t}": means[kind][TERMS.index(t)] for t in SHOWN[kind]}
        return found


KINDS = {WALKING: "walk", STANDING: "stand", TURNING: "turn", STRAFING: "strafe"}
SHOWN = {
    WALKING: ("speed", "facing", "skating", "sliding", "upright", "seam"),
    STANDING: ("stillness", "goal_distance", "sliding", "seam"),
    TURNING: ("facing", "goal_distance", "sliding"),
    STRAFING: ("facing", "goal_distance", "sliding"),
}


def train_analytic(
    config: AnalyticConfig,
    train: Frames,
    validation: Frames,
    folder: Path,
    minutes: float = float("inf"),
) -> bool:
    """Train or resume in `folder`. True when all steps are done."""
    trainer = AnalyticTrainer(config, train, validation)
    trainer.run = TrainingRun(folder, config, trainer.policy, trainer.optimizer)
    return trainer.run.drive(config.steps, trainer.update, trainer.validate, minutes, every=200)
