"""Train the marker predictor: per primitive, then over rollouts (paper Sec. 3.2.2, Eq. 1)."""

from collections.abc import Iterator
from pathlib import Path

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor

from wayfarer.body.library import load_body
from wayfarer.errors import InvalidArgument
from wayfarer.marker_bodies import marker_body
from wayfarer.motion.frame import canonical_frame, to_local, to_world
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.primitive import PrimitiveStep, Settled
from wayfarer.motion.quality import Sites
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import GENDERS, PRIMITIVE_FRAMES
from wayfarer_lab.training.dataset import Frames, WindowSampler
from wayfarer_lab.training.rotation import matrix_from_quaternion
from wayfarer_lab.training.run import TrainingRun, cosine_rate, load_weights


class PredictorConfig(BaseModel):
    """What a predictor is trained with; files in `training/configs/`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    seed_frames: int = 2
    steps: int = 12_000
    batch: int = 1024
    rate: float = 1e-3
    kl_weight: float = 0.1
    velocity_weight: float = 3.0  # λ of Eq. 1
    floor_origin: bool = True
    learned_prior: bool = True  # False: N(0, I), as in the paper
    rollout: int = 1  # primitives per window; 8 in the paper's second stage
    regressors: dict[str, str] = {}  # run folders by gender: seeds of rollouts as they are served
    start_from: str = ""  # run folder whose weights to begin with
    compile: bool = False  # torch.compile the loss: a quarter faster after a minute; needs g++
    mix: dict[str, float] = {
        "walk": 0.4,
        "run": 0.05,
        "start_stop": 0.25,
        "turn": 0.1,
        "standing": 0.1,
        "other": 0.1,
    }  # share of draws, see dataset.group_of
    seed: int = 0


def primitive_loss(
    model: MarkerPredictor, seed: Tensor, future: Tensor, config: PredictorConfig
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Eq. 1 for seed [B, S, 201], future [B, F, 201]: reconstruction, velocity and KL terms, Y^rec.

    The step from the last seed frame to the first new one counts as velocity too, which GAMMA's
    code leaves out: it is the seam that viewers see.
    """
    posterior = model.encode(seed, future)
    guess = model.decode(seed, posterior.sample()[:, None])[:, 0].float()
    reconstruction = (guess - future).abs().mean()
    last = seed[:, -1:, : future.shape[-1]]
    before = torch.cat([last, future[:, :-1]], 1)
    guess_before = torch.cat([last, guess[:, :-1]], 1)
    velocity = ((guess - guess_before) - (future - before)).abs().mean()
    kl = posterior.kl().float().mean()
    return reconstruction, velocity, torch.sqrt(1 + kl * kl) - 1, guess


class Serving:
    """What the service makes of predicted markers, for rows of both genders."""

    def __init__(self, config: PredictorConfig) -> None:
        missing = sorted(set(GENDERS) - set(config.regressors))
        if missing:
            raise InvalidArgument(f"no run of a regressor for {missing}", "regressors")
        self.steps = [self._step(config, gender) for gender in GENDERS]

    def _step(self, config: PredictorConfig, gender: str) -> PrimitiveStep:
        model = load_body("anny52", gender)
        body = marker_body(model)
        regressor = load_weights(BodyRegressor(body), Path(config.regressors[gender]))
        half = torch.autocast("cpu", dtype=torch.bfloat16)
        regressor.know = half(regressor.know)  # type: ignore[method-assign]
        regressor.correct = half(regressor.correct)  # type: ignore[method-assign]
        sites = Sites.from_names(model.marker_names)
        # the predictor is the one in training: only what follows it is asked of this step
        empty = MarkerPredictor(config.seed_frames)
        return PrimitiveStep(empty, regressor, body, sites, floor_origin=config.floor_origin)

    @torch.no_grad()
    def follow(
        self,
        frames: Frames,
        starts: Tensor,  # [B] whose bodies they are
        seed: Tensor,  # [B, S, 67, 3] world
        future: Tensor,  # [B, F, 201] in the canonical frame of the seed
        hips: Tensor,  # [B, S, 3] world
        rotations: Tensor,  # [B, S, 22, 4]
    ) -> Settled:
        """The bodies behind the markers of `future`."""
        parts, order = [], []
        for number, step in enumerate(self.steps):
            rows = torch.nonzero(frames.gender[starts] == number).squeeze(-1)
            if len(rows):
                betas = frames.betas[starts[rows]]
                found = step.follow(seed[rows], hips[rows], rotations[rows], betas, future[rows])
                parts.append(found)
                order.append(rows)
        back = torch.cat(order).argsort()
        return Settled(*(torch.cat(column)[back] for column in zip(*parts, strict=True)))


class PredictorTrainer:
    """One stage of training; `rollout` = 1 is the first."""

    def __init__(self, config: PredictorConfig, train: Frames, validation: Frames) -> None:
        torch.manual_seed(config.seed)
        self.config = config
        self.frames, self.validation = train, validation
        self.model = self.network()
        self.loss = torch.compile(primitive_loss) if config.compile else primitive_loss
        self.optimizer = torch.optim.Adam(self.model.parameters(), lr=config.rate, fused=True)
        self.stride = PRIMITIVE_FRAMES - config.seed_frames
        # long clips are scarce: shorter rollouts keep the others in use
        lengths = {config.rollout, max(1, config.rollout // 2), max(1, config.rollout // 4)}
        self.samplers = {
            n: WindowSampler(train, self.window(n)) for n in sorted(lengths, reverse=True)
        }
        self.serving = Serving(config) if config.regressors else None
        self.run: TrainingRun | None = None

    def network(self) -> MarkerPredictor:
        """What is trained, with the weights that it starts from."""
        model = MarkerPredictor(self.config.seed_frames)
        if self.config.start_from:
            load_weights(model, Path(self.config.start_from)).train()
        if not self.config.learned_prior:
            if any(bool(p.any()) for p in model.prior[-1].parameters()):
                raise InvalidArgument(
                    f"{self.config.start_from} has a learned prior: it cannot go on as one with "
                    "N(0, I)",
                    "learned_prior",
                )
            model.prior.requires_grad_(False)
        return model

    def condition(self, frames: Frames, at: Tensor, seed: Tensor) -> Tensor:
        """What the model is given of seeds [B, S, 201], which begin at frames `at` [B]."""
        return seed

    def window(self, primitives: int) -> int:
        """Frames that `primitives` overlapping primitives cover."""
        return self.config.seed_frames + primitives * self.stride

    def losses(
        self, frames: Frames, starts: Tensor, primitives: int
    ) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
        """Terms of each primitive of a rollout; the graph of one is freed before the next.

        Seeds after the first are the model's own last frames, detached. In the paper they are what
        was predicted, in the frame of reference of the recorded motion. With `regressors` they are
        what the service hands on: half the markers of the regressed body, set on the floor, in that
        body's own frame.
        """
        s, config = self.config.seed_frames, self.config
        world = frames.world(starts, self.window(primitives))
        begin = starts[:, None] + torch.arange(s)
        seed_world, hips, rotations = world[:, :s], frames.hips[begin], frames.rotations[begin]
        for p in range(primitives):
            at = starts + p * self.stride
            if self.serving:
                frame = canonical_frame(
                    hips[:, 0], matrix_from_quaternion(rotations[:, 0, 0]), config.floor_origin
                )
            else:
                frame = canonical_frame(
                    frames.hips[at], frames.hips_rotation[at], config.floor_origin
                )
            target = world[:, s + p * self.stride : s + (p + 1) * self.stride]
            seed = to_local(frame, seed_world.flatten(1, 2)).reshape(len(starts), s, -1)
            seed = self.condition(frames, at, seed)
            future = to_local(frame, target.flatten(1, 2)).reshape(len(starts), self.stride, -1)
            with torch.autocast("cpu", dtype=torch.bfloat16):
                reconstruction, velocity, kl, guess = self.loss(self.model, seed, future, config)
            yield reconstruction, velocity, kl
            if p + 1 == primitives:
                break
            guess = guess.detach()
            if self.serving:
                made = self.serving.follow(frames, starts, seed_world, guess, hips, rotations)
                seed_world = made.next_seed_markers
                hips, rotations = made.translation[:, -s:], made.rotations[:, -s:]
            else:
                last = guess[:, -s:].reshape(len(starts), -1, 3)
                seed_world = to_world(frame, last).unflatten(1, (s, -1))

    def update(self) -> dict[str, float]:
        """One optimiser step."""
        assert self.run is not None
        lengths = list(self.samplers)
        share = torch.tensor([0.6, 0.25, 0.15][: len(lengths)])
        primitives = lengths[int(torch.multinomial(share, 1))]
        starts = self.samplers[primitives].draw(self.config.batch // (1 if primitives == 1 else 2))
        for group in self.optimizer.param_groups:
            group["lr"] = cosine_rate(self.config.rate, self.run.step, self.config.steps)
        self.optimizer.zero_grad()
        total = torch.zeros(3)
        for reconstruction, velocity, kl in self.losses(self.frames, starts, primitives):
            loss = (
                reconstruction + self.config.velocity_weight * velocity + self.config.kl_weight * kl
            )
            (loss / primitives).backward()
            total += torch.stack([reconstruction, velocity, kl]).detach() / primitives
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)
        self.optimizer.step()
        return dict(zip(("reconstruction", "velocity", "kl"), total.tolist(), strict=True))

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Mean marker error in cm on fixed validation windows: posterior, prior, best of 10."""
        length = self.window(1)
        starts, _ = self.validation.starts(length)
        starts = starts[:: max(1, len(starts) // 1024)]
        windows = self.validation.canonical(starts, length, self.config.floor_origin)
        seed, future = windows[:, : self.config.seed_frames], windows[:, self.config.seed_frames :]
        seed = self.condition(self.validation, starts, seed)
        generator = torch.Generator().manual_seed(1)
        latent = torch.randn(len(starts), 10, 128, generator=generator)
        prior = self.model.decode(seed, latent)
        mean = self.model.decode(seed, self.model.encode(seed, future).mean[:, None])[:, 0]
        error = _marker_error(prior, future[:, None])
        return {
            "val/posterior_cm": float(_marker_error(mean, future).mean()),
            "val/prior_cm": float(error.mean()),
            "val/best_of_10_cm": float(error.amin(1).mean()),
        }


def _marker_error(guess: Tensor, truth: Tensor) -> Tensor:
    """Mean distance per marker in cm. [..., F, 201] → [...]"""
    return 100 * (guess - truth).unflatten(-1, (-1, 3)).norm(dim=-1).mean((-1, -2))


def train_predictor(
    config: PredictorConfig,
    train: Frames,
    validation: Frames,
    folder: Path,
    minutes: float = float("inf"),
) -> bool:
    """Train or resume in `folder`. True when all steps are done."""
    trainer = PredictorTrainer(config, train, validation)
    trainer.run = TrainingRun(folder, config, trainer.model, trainer.optimizer)
    return trainer.run.drive(config.steps, trainer.update, trainer.validate, minutes)
