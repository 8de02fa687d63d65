"""Train the policy by analytic gradients: the quality terms of a few steps, differentiated.

Search asks which of K latents brings the least weighted sum of quality terms. The terms are
differentiable functions of the latent, so a policy can learn the answer directly: every step of
every agent tells it the slope in all 128 dimensions, where PPO (`training/policy.py`, the paper's
way) learns one number from it. PPO may go on from here.
"""

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
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.motion.quality import Sites
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import GENDERS, LATENT
from wayfarer.terms import TERMS
from wayfarer_lab.training.crowd import Crowd, CrowdSampler
from wayfarer_lab.training.dataset import Frames
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
    kl_weight: float = 1.0  # of KL(π ‖ N(0, I)) per latent dimension
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
            tasks.facing,
            weight,
            torch.ones(count),
            torch.randn(count, 1, LATENT),
            no_obstacles(count),
        )
        assert self.watched.last is not None
        cost = (result.terms * weight).sum(-1)
        return crowd.after(result), cost, result.terms, self.watched.last

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
            sound = sound * (~crowd.broken()).float()  # what follows a fall teaches nothing
            # a cost is worth no more than a fall's: slopes of freak bodies would drown the rest
            total = total + (sound * cost).nan_to_num().clamp(max=20.0).mean() / config.horizon
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
