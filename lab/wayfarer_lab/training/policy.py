"""Train the goal policy by PPO in simulation (paper Sec. 3.3.1, Eq. 10, supplementary B.2)."""

import time
from pathlib import Path
from typing import Literal

import matplotlib
import numpy as np
import torch
from matplotlib.figure import Figure
from pydantic import BaseModel, ConfigDict
from torch import Tensor

from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.errors import InvalidArgument
from wayfarer.motion.policy import GoalPolicy
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.motion.quality import Sites
from wayfarer.spec import GENDERS
from wayfarer_lab.training.dataset import Poses
from wayfarer_lab.training.environment import GoalEnvironment, Task
from wayfarer_lab.training.episode import Episode, GoalCredit, samples_of, simulate
from wayfarer_lab.training.pose_prior import load_pose_prior
from wayfarer_lab.training.ppo import PpoSettings, update
from wayfarer_lab.training.precision import half_precision
from wayfarer_lab.training.regressor import load_regressor
from wayfarer_lab.training.reward import REWARD, REWARDS
from wayfarer_lab.training.run import (
    TrainingRun,
    load_goal_policy,
    load_predictor,
    read_run_config,
)
from wayfarer_lab.training.starts import StartSampler


class PolicyConfig(BaseModel):
    """Settings of a training by PPO."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    seed_frames: int = 2
    predictor: str = "runs/predictor_2f_rollout"  # run folders of the networks it acts on
    lead: str = ""  # of a 1-frame predictor that makes the first primitive, as in the paper
    regressor_male: str = "runs/regressor_male"
    regressor_female: str = "runs/regressor_female"
    pose_prior: str = "runs/pose_prior"  # or a VPoser v2 checkpoint of your own
    start_from: str = ""  # run folder of a policy to begin with
    epochs: int = 500
    critic_epochs: int = (
        0  # first epochs, in which only the critic trains: for a policy without one
    )
    starts: int = 8  # simulations per epoch
    clones: int = 32  # agents per simulation
    primitives: int = 60
    reward: dict[str, float] = REWARD  # β of Eq. 4
    ends: Literal["each", "all"] = "each"  # all: clones go on until all have arrived (the paper)
    arrival: float = 1.0  # share of all reward that an agent gets for ever once it has arrived
    goal_credit: GoalCredit = "episode"  # which primitives r_goal is credited to
    start_kinds: dict[str, float] = {"standing": 0.45, "moving": 0.45, "pose_prior": 0.1}
    moving_mix: dict[str, float] = {"walk": 0.6, "start_stop": 0.2, "turn": 0.2}
    task: Task = Task()
    ppo: PpoSettings = PpoSettings()
    snapshot_every: int = 10  # epochs
    seed: int = 0


def reward_weights(table: dict[str, float]) -> Tensor:
    """Weights [R] in the order of `reward.REWARDS`. Raises InvalidArgument."""
    unknown = sorted(set(table) - set(REWARDS))
    if unknown:
        raise InvalidArgument(f"unknown rewards {unknown}; allowed: {list(REWARDS)}", "reward")
    weights = torch.tensor([table.get(name, 0.0) for name in REWARDS])
    if (weights < 0).any() or not weights.any():
        raise InvalidArgument("weights must be 0 or more, and one of them more", "reward")
    return weights


class PolicyTrainer:
    """One epoch: simulate, then learn from what was seen."""

    def __init__(self, config: PolicyConfig, environment: GoalEnvironment) -> None:
        torch.manual_seed(config.seed)
        self.config = config
        self.environment = environment
        self.weights = reward_weights(config.reward)
        start = config.start_from
        self.model = load_goal_policy(Path(start)).train() if start else GoalPolicy()
        self.optimizer = torch.optim.Adam(self.model.parameters(), lr=config.ppo.rate, fused=True)
        self.run: TrainingRun | None = None

    def update(self) -> dict[str, float]:
        """One epoch; every curve goes to TensorBoard."""
        assert self.run is not None
        config = self.config
        began = time.perf_counter()
        agents = self.environment.reset(config.starts, config.clones)
        together = config.clones if config.ends == "all" else 1
        episode = simulate(self.environment, self.model, agents, config.primitives, together)
        simulated = time.perf_counter()
        arrival = None if config.ends == "all" else config.arrival
        samples = samples_of(
            episode, self.weights, arrival, config.ppo, config.clones, config.goal_credit
        )
        limit = -1.0 if self.run.step < config.critic_epochs else config.ppo.kl_limit
        settings = config.ppo.model_copy(update={"kl_limit": limit})
        slow = self.run.step < config.ppo.slow_epochs
        for group in self.optimizer.param_groups:
            group["lr"] = config.ppo.rate * (0.5 if slow else 1.0)
        learning = update(self.model, self.optimizer, samples, settings)
        speed = {
            "time/agent_steps_per_second": len(samples.latent) / (simulated - began),
            "time/learning_seconds": time.perf_counter() - simulated,
        }
        residual = samples.returns - episode.values[episode.alive]
        explained = float(1 - residual.var() / samples.returns.var())
        seen = summary(episode, self.weights)
        self.run.log(**seen, **learning, **speed, **{"ppo/explained_variance": explained})
        return {name: seen[name] for name in ("reward", "success")}

    def validate(self) -> dict[str, float]:
        """The same 16 starts and goals, 4 clones each, every time; a picture of their trails."""
        assert self.run is not None
        clones = 4
        with torch.random.fork_rng():
            torch.manual_seed(1)
            agents = self.environment.reset(16, clones)
            episode = simulate(self.environment, self.model, agents, self.config.primitives)
        shown = {f"val/{name}": value for name, value in summary(episode, self.weights).items()}
        draw_trails(
            self.run.folder / "snapshots" / f"epoch_{self.run.step:05d}.png",
            episode.hips,
            agents.goal,
            clones,
            f"epoch {self.run.step}: {shown['val/success']:.0%} of {len(agents.goal)} arrive",
        )
        return shown


def summary(episode: Episode, weights: Tensor) -> dict[str, float]:
    """Means over agents: share of all reward (Eq. 4 / Σ β), arrivals, …, and each single reward."""
    mean = episode.rewards[episode.alive].mean(0).tolist()
    arrived = episode.steps[episode.reached].float()
    return {
        "reward": float((torch.tensor(mean) @ weights) / weights.sum()),
        "success": float(episode.reached.float().mean()),
        "broken": float(episode.broken.float().mean()),
        "steps": float(arrived.mean()) if len(arrived) else float(len(episode.alive)),
        "distance": float(episode.closest.clamp(max=100).mean()),
    } | {f"reward/{name}": value for name, value in zip(REWARDS, mean, strict=True)}


def load_steps(
    config: PolicyConfig, folder: str, seed_frames: int, field: str = "predictor"
) -> tuple[PrimitiveStep, ...]:
    """The step of each gender with the predictor of a run folder.

    The regressor is in half precision, which moves markers by 0.1 mm. (The predictor in bfloat16
    would move them by 1.6 mm and be no faster.) Raises InvalidArgument, naming the config's
    `field`, when the predictor has another number of seed frames.
    """
    trained = read_run_config(Path(folder))
    if trained["seed_frames"] != seed_frames:
        raise InvalidArgument(
            f"{folder} was trained with {trained['seed_frames']} seed frames, "
            f"this policy wants {seed_frames}",
            field,
        )
    half = half_precision()
    predictor = load_predictor(Path(folder), seed_frames)
    steps = []
    for gender in GENDERS:
        model = load_body("anny52", gender)
        body = marker_body(model)
        run = Path(getattr(config, f"regressor_{gender}"))
        regressor = load_regressor(body, run)
        regressor.correct = half(regressor.correct)  # type: ignore[method-assign]
        sites = Sites.from_names(model.marker_names)
        steps.append(
            PrimitiveStep(predictor, regressor, body, sites, None, trained["floor_origin"])
        )
    return tuple(step.eval().requires_grad_(False) for step in steps)


def load_environment(config: PolicyConfig, moving: Poses, standing: Tensor) -> GoalEnvironment:
    """The environment of trained networks. `standing` [P, 22, 4]: `assets/start_poses.npz`."""
    prior = load_pose_prior(Path(config.pose_prior)).requires_grad_(False)
    steps = load_steps(config, config.predictor, config.seed_frames)
    lead = load_steps(config, config.lead, 1, "lead") if config.lead else ()
    frames = 1 if config.lead else config.seed_frames
    starts = StartSampler(frames, config.start_kinds, standing, moving, prior)
    return GoalEnvironment(steps, prior, starts, config.task, lead)


def train_policy(
    config: PolicyConfig,
    environment: GoalEnvironment,
    folder: Path,
    minutes: float = float("inf"),
) -> bool:
    """Trains or resumes in `folder`. True when all epochs are done."""
    trainer = PolicyTrainer(config, environment)
    trainer.run = TrainingRun(folder, config, trainer.model, trainer.optimizer)
    if trainer.run.step == 0:
        trainer.run.log(**trainer.validate())  # what training is to improve on
    return trainer.run.drive(
        config.epochs, trainer.update, trainer.validate, minutes, every=config.snapshot_every
    )


def draw_trails(path: Path, hips: Tensor, goals: Tensor, clones: int, title: str) -> None:
    """Writes a PNG of trails: hips [T, A, 3] (NaN when no longer going), goals [A, 3].

    `clones` agents after one another share start and goal, hence a colour. A ring is a goal, a dot
    the end of a trail.
    """
    figure = Figure(figsize=(6, 6), dpi=100)
    axes = figure.add_subplot()
    colours = matplotlib.colormaps["tab20"]
    trails, places = hips[..., :2].numpy(), goals[..., :2].numpy()
    for agent in range(trails.shape[1]):
        colour = colours(agent // clones % colours.N)
        trail = trails[np.isfinite(trails[:, agent]).all(-1), agent]
        axes.plot(*trail.T, color=colour, linewidth=0.8)
        axes.plot(*trail[-1], ".", color=colour, markersize=4)
        if agent % clones == 0:
            axes.plot(*places[agent], "o", color=colour, fillstyle="none", markersize=10)
    axes.set_aspect("equal")
    axes.set_title(title, fontsize=10)
    axes.grid(alpha=0.3)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, bbox_inches="tight")
