"""Train the policy by analytic gradients: the quality terms of a few steps, differentiated.

Search asks which of K latents brings the least weighted sum of quality terms. The terms are
differentiable functions of the latent, so a policy can learn the answer directly: every step of
every agent tells it the slope in all 128 dimensions, where PPO (`training/policy.py`, the paper's
way) learns one number from it. PPO may go on from here.
"""

import copy
from pathlib import Path
from typing import NamedTuple

import torch
from pydantic import BaseModel, ConfigDict, model_validator
from torch import Tensor, nn
from torch.optim import Optimizer

from wayfarer.body.library import SHIPPED, load_body
from wayfarer.errors import InvalidArgument
from wayfarer.marker_bodies import load_marker_bodies, marker_body
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.obstacles import no_obstacles
from wayfarer.motion.policy import Condition, Gaussian, GoalPolicy
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.motion.quality import Sites
from wayfarer.spec import GENDERS, LATENT, NEW_FRAMES
from wayfarer.terms import TERMS, WALK
from wayfarer_lab.training.crowd import CrowdSampler, TrainingCrowd
from wayfarer_lab.training.dataset import Frames
from wayfarer_lab.training.likeness import FRAMES
from wayfarer_lab.training.mocap.store import Dataset
from wayfarer_lab.training.posture import LOOSE, Posture, off_body
from wayfarer_lab.training.precision import half_precision
from wayfarer_lab.training.regressor import load_regressor
from wayfarer_lab.training.run import (
    TrainingRun,
    cosine_rate,
    load_goal_policy,
    load_predictor,
)
from wayfarer_lab.training.steady import (
    LikenessConfig,
    SteadyWalks,
    WatchedDecoder,
    shown_markers,
)
from wayfarer_lab.training.tasks import (
    STANDING,
    STRAFING,
    TURNING,
    WALKING,
    Share,
    TaskMix,
    Tasks,
    Weight,
    draw_tasks,
)
from wayfarer_lab.training.walks import SPEEDS, Walks


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
    average: Share = 0.0  # of the weights' moving average is kept at each update; 0: no average
    speed_band: Weight = 0.0  # m/s off the target speed that cost a walker nothing
    noise: tuple[float, float] = (1.0, 1.0)  # temperatures of the latents' noise, drawn by agent
    likeness: LikenessConfig | None = None  # a critic of steady walks; None: there is none
    tasks: TaskMix = TaskMix()
    start_from: str = ""  # run folder of a policy to go on from
    mix: dict[str, float] = {
        "walk": 0.35,
        "run": 0.05,
        "start_stop": 0.25,
        "turn": 0.15,
        "standing": 0.2,
    }  # where new agents begin, see dataset.group_of
    seed: int = 0

    @model_validator(mode="after")
    def _fits(self) -> "AnalyticConfig":
        if self.likeness and self.horizon * NEW_FRAMES >= FRAMES:
            raise ValueError(
                f"horizon {self.horizon} leaves nothing to remember of the critic's windows of "
                f"{FRAMES} frames: at most {FRAMES // NEW_FRAMES - 1} with [likeness]"
            )
        if not 0 <= self.noise[0] <= self.noise[1]:
            raise ValueError(f"noise {self.noise} is not a range of temperatures: low, high")
        return self


FALL = 20.0
"""What a fall costs: as much as the dearest step."""


def priced(cost: Tensor, broken: Tensor) -> Tensor:
    """What steps cost [A]: the one in which an agent broke as much as a fall, others less.

    Slopes of freak bodies would drown the rest otherwise.
    """
    bounded = FALL * torch.tanh(cost.nan_to_num(FALL) / FALL)
    return torch.where(broken, FALL, bounded)


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


SPEED = TERMS.index("speed")


class Advance(NamedTuple):
    """What one step of a crowd of A agents brings."""

    after: TrainingCrowd
    cost: Tensor  # [A]
    terms: Tensor  # [A, T]
    distribution: Gaussian  # π of the latents
    shown: Tensor  # [A, 8, 67, 3], see `shown_markers`; without [likeness] empty


class AnalyticTrainer:
    """Two crowds, one per gender, that never stop; every update continues one of them."""

    def __init__(
        self,
        config: AnalyticConfig,
        train: Frames,
        validation: Frames,
        walks: Walks | None = None,
    ) -> None:
        """Recorded `walks` are needed with [likeness]. Raises InvalidArgument without."""
        if config.likeness and walks is None:
            raise InvalidArgument("a critic ([likeness]) needs recorded walks", "walks")
        torch.manual_seed(config.seed)
        self.config = config
        start = config.start_from
        self.policy = load_goal_policy(Path(start)).train() if start else GoalPolicy()
        self.average = copy.deepcopy(self.policy).requires_grad_(False)
        self.watched = Watched(self.policy)
        names = load_body("anny52", GENDERS[0]).marker_names
        self.posture = Posture.from_names(names)
        self.decoders: dict[str, WatchedDecoder] = {}
        self.steps = {g: self._step(g) for g in GENDERS}
        self.samplers = {g: CrowdSampler(train, s.body) for g, s in self.steps.items()}
        self.trials = {g: CrowdSampler(validation, s.body) for g, s in self.steps.items()}
        self.crowds = {g: s.draw(config.agents) for g, s in self.samplers.items()}
        self.tasks = {
            g: draw_tasks(c.place, c.facing, config.tasks) for g, c in self.crowds.items()
        }
        self.optimizer = torch.optim.Adam(self.policy.parameters(), lr=config.rate, fused=True)
        self.run: TrainingRun | None = None
        self.steady: SteadyWalks | None = None
        if config.likeness and walks is not None:
            self.steady = SteadyWalks(config.likeness, walks, names, config.agents, config.horizon)

    def _step(self, gender: str) -> PrimitiveStep:
        model = load_body("anny52", gender)
        body: MarkerBody = marker_body(model)
        predictor = load_predictor(Path(self.config.predictor), 2)
        regressor = load_regressor(body, Path(self.config.regressors[gender]))
        sites = Sites.from_names(model.marker_names)
        for network in (predictor, regressor):
            network.requires_grad_(False)
        # matrix products in bfloat16; skinning and terms stay in float32
        half = half_precision()
        self.decoders[gender] = WatchedDecoder(half(predictor.decode))
        predictor.decode = self.decoders[gender]  # type: ignore[method-assign,assignment]
        regressor.correct = half(regressor.correct)  # type: ignore[method-assign]
        # No slope flows through the bodies: the terms are of the predicted markers.
        regressor.solve = torch.no_grad()(regressor.solve)  # type: ignore[method-assign]
        return PrimitiveStep(predictor, regressor, body, sites, self.watched)  # type: ignore[arg-type]

    def advance(self, gender: str, crowd: TrainingCrowd, tasks: Tasks) -> Advance:
        """One step of a crowd."""
        config, step = self.config, self.steps[gender]
        count, weight = len(crowd.betas), tasks.term_weights()
        low, high = config.noise
        noise = (low + (high - low) * torch.rand(count, 1, 1)) * torch.randn(count, 1, LATENT)
        result = step(
            crowd.markers,
            crowd.translation.detach(),
            crowd.rotations.detach(),
            crowd.betas,
            tasks.goal,
            tasks.target_speed(crowd.place.detach(), crowd.speed.detach()),
            tasks.wished_facing(crowd.facing.detach()),
            weight,
            torch.ones(count),
            noise,
            no_obstacles(count),
        )
        future = self.decoders[gender].last
        assert self.watched.last is not None and future is not None
        terms, after = result.terms, crowd.after(result)
        cost = (terms * weight).sum(-1)
        if config.speed_band:  # who goes at a natural gait leaves his mean speed within a step
            walks = (tasks.kind == WALKING) & (tasks.speed < SPEEDS[1])
            free = terms[:, SPEED].clamp(max=config.speed_band)
            cost = cost - torch.where(walks, WALK["speed"], 0.0) * free
        strain = self.posture.strain(after.markers[:, -1], step.body.resting(crowd.betas))
        cost = cost + config.strain_weight * strain
        cost = cost + config.body_weight * (off_body(after, step.body) - LOOSE).clamp(min=0)
        shown = torch.empty(0)
        if self.steady is not None:
            shown = shown_markers(step, crowd, result, future[:, 0])
        return Advance(after, cost, terms, self.watched.last, shown)

    def update(self) -> dict[str, float]:
        """One optimiser step."""
        assert self.run is not None
        config, gender = self.config, GENDERS[self.run.step % len(GENDERS)]
        for group in self.optimizer.param_groups:
            group["lr"] = cosine_rate(config.rate, self.run.step, config.steps)
        crowd, tasks = self.crowds[gender], self.tasks[gender]
        total, divergence = torch.zeros(()), torch.zeros(())
        sound = torch.ones(config.agents)
        shown = []
        for _ in range(config.horizon):
            crowd, cost, _, distribution, frames = self.advance(gender, crowd, tasks)
            if self.steady is not None:
                shown.append(frames)
                self.steady.count(gender, crowd, tasks)
            cost = priced(cost, crowd.broken())
            total = total + (sound * cost).mean() / config.horizon
            sound = sound * (~crowd.broken()).float()  # what follows a fall teaches nothing
            divergence = divergence + distribution.kl().mean() / config.horizon
        unlikely = torch.zeros(())
        seen: dict[str, float] = {}
        if self.steady is not None:
            resting = self.steps[gender].body.resting(crowd.betas)
            unlikely, seen = self.steady.judge(gender, torch.cat(shown, 1), tasks, resting)
        self.optimizer.zero_grad()
        (total + unlikely + config.kl_weight * divergence).backward()
        norm = torch.nn.utils.clip_grad_norm_(self.policy.parameters(), 1.0)
        if norm.isfinite():
            self.optimizer.step()
        for kept, new in zip(self.average.parameters(), self.policy.parameters(), strict=True):
            kept.lerp_(new.detach(), 1 - config.average)
        self._go_on(gender, crowd.detached(), tasks)
        return {
            "cost": float(total.detach()),
            "kl": float(divergence.detach()),
            "fallen": float(1 - sound.mean()),
        } | seen

    def _go_on(self, gender: str, crowd: TrainingCrowd, tasks: Tasks) -> None:
        """Renew tasks; replace broken agents, and some others, by new ones."""
        tasks.renew(crowd.place, crowd.facing, self.config.tasks)
        leave = crowd.broken() | (torch.rand(self.config.agents) < self.config.renewal)
        rows = torch.nonzero(leave).squeeze(-1)
        if len(rows):
            crowd.put(rows, self.samplers[gender].draw(len(rows)))
            drawn = draw_tasks(crowd.place[rows], crowd.facing[rows], self.config.tasks)
            tasks.put(rows, drawn)
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
            tasks = draw_tasks(crowd.place, crowd.facing, self.config.tasks)
            for _ in range(20):
                crowd, _, terms, _, _ = self.advance(gender, crowd, tasks)
                for kind in KINDS:
                    of_kind = terms[tasks.kind == kind].nan_to_num()
                    sums[kind] += of_kind.sum(0)
                    counts[kind] += len(of_kind)
                tasks.renew(crowd.place, crowd.facing, self.config.tasks)
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


def load_walks(folder: Path) -> Walks:
    """The critic's recorded walks from a prepared folder, which takes a minute.

    Raises DataError when the folder is not prepared, InvalidArgument when it holds no such walk.
    """
    return Walks(Dataset.load(folder), "train", load_marker_bodies(SHIPPED))


def train_analytic(
    config: AnalyticConfig,
    train: Frames,
    validation: Frames,
    folder: Path,
    minutes: float = float("inf"),
    walks: Walks | None = None,
) -> bool:
    """Train or resume in `folder`, the critic included. True when all steps are done.

    A training that starts from another run with a critic goes on with that critic.
    """
    trainer = AnalyticTrainer(config, train, validation, walks)
    others: dict[str, nn.Module | Optimizer] = {}
    if config.average:
        others["average"] = trainer.average
    if trainer.steady is not None:
        others["critic"] = trainer.steady.critic
        others["critic_optimizer"] = trainer.steady.optimizer
        if config.start_from:
            known = torch.load(Path(config.start_from) / "last.pt", weights_only=True)
            if "critic" in known:
                trainer.steady.critic.load_state_dict(known["critic"])
    trainer.run = TrainingRun(folder, config, trainer.policy, trainer.optimizer, others)
    return trainer.run.drive(config.steps, trainer.update, trainer.validate, minutes, every=100)
