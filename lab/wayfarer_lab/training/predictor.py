"""Train the marker predictor: per primitive, then over rollouts (paper Sec. 3.2.2, Eq. 1)."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal, NamedTuple

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor, nn

from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.errors import InvalidArgument
from wayfarer.motion.frame import canonical_frame, to_local
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.primitive import PrimitiveStep, Settled
from wayfarer.motion.quality import CONTACT_HEIGHT, Sites
from wayfarer.spec import FPS, GENDERS, MARKERS, PRIMITIVE_FRAMES
from wayfarer_lab.training.dataset import Frames, PairedSampler, in_halves
from wayfarer_lab.training.foot_lock import TrainingFootLock
from wayfarer_lab.training.precision import half_precision
from wayfarer_lab.training.regressor import load_regressor
from wayfarer_lab.training.representation import REPRESENTATIONS, Markers, Name, Whose
from wayfarer_lab.training.rotation import matrix_from_quaternion
from wayfarer_lab.training.run import TrainingRun, cosine_rate, load_predictor

RESTS = 0.004
"""Metres a frame (.16 m/s): a recorded sole that is slower bears weight."""

LOW = 0.1
"""Metres: a sole that moves lower may drag; a centimetre of error is seen there, not higher."""

SWINGS = 0.025
"""Metres a frame (1 m/s): the height of a sole that is faster counts in full."""


class PredictorConfig(BaseModel):
    """Settings of the training of a predictor; files in `training/configs/`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    representation: Name = "markers"
    seed_frames: int = 2
    steps: int = 12_000
    batch: int = 1024
    rate: float = 1e-3
    kl_weight: float = 0.1
    velocity_weight: float = 3.0  # λ of Eq. 1
    floor_origin: bool = True
    learned_prior: bool = True  # False: N(0, I), as in the paper
    head_weight: float = 1.0  # of the five markers of the head: too few, it hardly turns
    slide_weight: float = 0.0  # of soles that move while the recorded ones rest, not in the paper
    lift_weight: float = 0.0  # of the height of soles that move low, not in the paper
    at_once: Literal[1, 2, 4, 8] = 1  # frames that a step of the decoder finds
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


def guess_primitive(model: MarkerPredictor, seed: Tensor, future: Tensor) -> tuple[Tensor, Tensor]:
    """A sample of the posterior of seed [B, S, size] and future [B, F, size], decoded, and the KL
    term of Eq. 1.
    """
    posterior = model.encode(seed, future)
    guess = model.decode(seed, posterior.sample()[:, None])[:, 0].float()
    kl = posterior.kl().float().mean()
    return guess, torch.sqrt(1 + kl * kl) - 1


def marker_terms(made: Tensor, truth: Tensor, weights: Tensor) -> tuple[Tensor, Tensor]:
    """The terms of Eq. 1 of markers [B, F, 201]: places and their change from frame to frame, with
    weights [201] whose mean is 1.

    The step from the last seed frame to the first new one counts too, which GAMMA's code leaves
    out: it is the seam that viewers see. Both begin at the same seed.
    """
    error = (made - truth) * weights
    change = torch.diff(error, dim=1, prepend=torch.zeros_like(error[:, :1]))
    return error.abs().mean(), change.abs().mean()


HEAD = ("ARIEL", "LFHD", "LBHD", "RFHD", "RBHD")


def marker_weights(head: float) -> Tensor:
    """Weights [201] of the numbers of a frame, those of the head `head` times the others'; their
    mean is 1.
    """
    names = load_body("anny52", GENDERS[0]).marker_names
    weights = torch.tensor([head if name in HEAD else 1.0 for name in names])
    return (weights / weights.mean()).repeat_interleave(3)


class Terms(NamedTuple):
    """Losses of a primitive, each a scalar."""

    reconstruction: Tensor  # metres, Eq. 1
    velocity: Tensor  # metres a frame, Eq. 1
    kl: Tensor  # Eq. 1
    slide: Tensor  # metres a frame, of soles whose recorded ones rest; not in the paper
    lift: Tensor  # metres, of the height of soles whose recorded ones move low; not in the paper


def sole_slide(made: Tensor, truth: Tensor, soles: Tensor) -> Tensor:
    """Mean way per frame of soles that rest in the recording, in plan.

    made, truth [B, F, 201]; `soles` are indices of markers. Each way is counted as |x| + |y|.
    """
    found, known = (
        markers.unflatten(-1, (MARKERS, 3)).index_select(-2, soles) for markers in (made, truth)
    )
    rests = torch.diff(known, dim=1)[..., :2].norm(dim=-1) < RESTS
    rests = (rests & (known[:, 1:, :, 2] < CONTACT_HEIGHT)).to(made.dtype)
    moved = torch.diff(found, dim=1)[..., :2].abs().sum(-1)
    return (moved * rests).sum() / (rests.sum() + 1)


def sole_lift(made: Tensor, truth: Tensor, soles: Tensor) -> Tensor:
    """Mean error of the height of soles that move low in the recording, weighed by their speed.

    made, truth [B, F, 201]; `soles` are indices of markers. A foot that glides a centimetre above
    the floor adds little to the mean error of all markers, but one sees that it drags.
    """
    found, known = (
        markers.unflatten(-1, (MARKERS, 3)).index_select(-2, soles) for markers in (made, truth)
    )
    speed = torch.diff(known, dim=1)[..., :2].norm(dim=-1)
    weight = (speed / SWINGS).clamp(max=1) * (known[:, 1:, :, 2] < LOW)
    off = (found - known)[:, 1:, :, 2].abs()
    return (off * weight).sum() / (weight.sum() + 1)


class Serving:
    """Processes predicted markers as the service does, for rows of both genders."""

    def __init__(
        self, regressors: Mapping[str, str], seed_frames: int = 2, floor_origin: bool = True
    ) -> None:
        """`regressors` are run folders by gender. Raises InvalidArgument when one is missing."""
        missing = sorted(set(GENDERS) - set(regressors))
        if missing:
            raise InvalidArgument(f"no run of a regressor for {missing}", "regressors")
        self.seed_frames, self.floor_origin = seed_frames, floor_origin
        self.steps = [self._step(Path(regressors[gender]), gender) for gender in GENDERS]
        self.locks = [TrainingFootLock(load_body("anny52", gender)) for gender in GENDERS]

    def _step(self, run: Path, gender: str) -> PrimitiveStep:
        model = load_body("anny52", gender)
        body = marker_body(model)
        regressor = load_regressor(body, run)
        regressor.correct = half_precision()(regressor.correct)  # type: ignore[method-assign]
        sites = Sites.from_names(model.marker_names)
        # the predictor is the one in training: only what follows it is asked of this step
        empty = MarkerPredictor(self.seed_frames)
        return PrimitiveStep(empty, regressor, body, sites, floor_origin=self.floor_origin)

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
        """The bodies behind the markers of `future`, feet locked; rows as a `PairedSampler` has
        them.
        """

        def of_gender(gender: int, rows: slice) -> Settled:
            betas = frames.betas[starts[rows]]
            return self.made(gender, seed[rows], hips[rows], rotations[rows], betas, future[rows])

        return Settled(*in_halves(range(len(GENDERS)), of_gender, len(starts)))

    @torch.no_grad()
    def made(
        self,
        gender: int,  # index in `GENDERS`
        seed: Tensor,
        hips: Tensor,
        rotations: Tensor,
        betas: Tensor,  # [B, 10]
        future: Tensor,
    ) -> Settled:
        """As `follow`, of bodies of one gender."""
        found = self.steps[gender].follow(seed, hips, rotations, betas, future)
        return self.locks[gender].apply(hips, rotations, betas, found)


class PredictorTrainer:
    """One stage of training; `rollout` = 1 is the first."""

    def __init__(self, config: PredictorConfig, train: Frames, validation: Frames) -> None:
        torch.manual_seed(config.seed)
        self.config = config
        self.frames, self.validation = train, validation
        self.kind = self.representation()
        self.model = self.network()
        self.guess = torch.compile(guess_primitive) if config.compile else guess_primitive
        self.optimizer = torch.optim.Adam(self.parameters(), lr=config.rate, fused=True)
        self.stride = PRIMITIVE_FRAMES - config.seed_frames
        # long clips are scarce: shorter rollouts keep the others in use
        lengths = {config.rollout, max(1, config.rollout // 2), max(1, config.rollout // 4)}
        self.samplers = {
            n: PairedSampler(train, self.window(n)) for n in sorted(lengths, reverse=True)
        }
        self.serving = (
            Serving(config.regressors, config.seed_frames, config.floor_origin)
            if config.regressors
            else None
        )
        sites = Sites.from_names(load_body("anny52", GENDERS[0]).marker_names)
        self.soles = torch.tensor(sites.left_sole + sites.right_sole)
        self.weights = marker_weights(config.head_weight)
        self.run: TrainingRun | None = None

    def representation(self) -> Markers:
        """The representation of frames. Raises InvalidArgument if it cannot be served."""
        if self.config.regressors and self.config.representation != "markers":
            raise InvalidArgument(
                f"seeds as they are served are markers, not {self.config.representation!r}",
                "regressors",
            )
        return REPRESENTATIONS[self.config.representation]()

    def network(self) -> MarkerPredictor:
        """The network to train, with its initial weights."""
        start, frames = self.config.start_from, self.config.seed_frames
        if start:
            model = load_predictor(Path(start), frames).train()
        else:
            model = MarkerPredictor(frames, self.kind.size, self.config.at_once)
        if model.size != self.kind.size:
            raise InvalidArgument(
                f"{start} has frames of {model.size} numbers, {self.config.representation!r} "
                f"frames of {self.kind.size}",
                "start_from",
            )
        if not self.config.learned_prior:
            if model.has_learned_prior:
                raise InvalidArgument(
                    f"{self.config.start_from} has a learned prior: it cannot go on as one with "
                    "N(0, I)",
                    "learned_prior",
                )
            model.prior.requires_grad_(False)
        return model

    def parameters(self) -> list[nn.Parameter]:
        """Weights that learn."""
        return list(self.model.parameters())

    def condition(self, frames: Frames, at: Tensor, seed: Tensor) -> Tensor:
        """The model's condition for seeds [B, S, 201], which begin at frames `at` [B]."""
        return seed

    def window(self, primitives: int) -> int:
        """Frames that `primitives` overlapping primitives cover."""
        return self.config.seed_frames + primitives * self.stride

    def losses(self, frames: Frames, starts: Tensor, primitives: int) -> Iterator[Terms]:
        """Terms of each primitive of a rollout; the graph of one is freed before the next.

        Seeds after the first are the model's own last frames, detached. In the paper they are the
        prediction, in the recorded motion's frame of reference. With `regressors` they are
        the service's next seeds: half the markers of the regressed body, set on the floor, in that
        body's own frame.
        """
        s, kind, floor = self.config.seed_frames, self.kind, self.config.floor_origin
        whose = Whose.of(frames, starts)
        within = torch.arange(s + self.stride)
        begin = starts[:, None] + within[:s]
        hips, rotations = frames.hips[begin], frames.rotations[begin]  # of seeds as served
        markers = frames.world(starts, s)
        seed, before = torch.empty(0), frames.frame(starts, floor)
        for p in range(primitives):
            at = starts + p * self.stride
            if self.serving:
                root = matrix_from_quaternion(rotations[:, 0, 0])
                frame = canonical_frame(hips[:, 0], root, floor)
            else:
                frame = frames.frame(at, floor)
            told = kind.recorded(frames, at[:, None] + within, frame)
            if self.serving:
                seed = to_local(frame, markers.flatten(1, 2)).reshape(len(starts), s, -1)
            else:
                seed = kind.moved(seed, before, frame) if p else told.features[:, :s]
            given, future = self.condition(frames, at, seed), told.features[:, s:]
            with half_precision():
                guess, kl = self.guess(self.model, given, future)
            made = kind.markers(guess, whose)
            reconstruction, velocity = marker_terms(made, told.markers[:, s:], self.weights)
            if (beside := kind.beside(guess)) and (true := kind.beside(future)):
                reconstruction = reconstruction + (beside.places - true.places).abs().mean()
                off = (beside.velocities - true.velocities).abs().mean()
                velocity = velocity + off / FPS
            slide = sole_slide(made, told.markers[:, s:], self.soles)
            lift = sole_lift(made, told.markers[:, s:], self.soles)
            yield Terms(reconstruction, velocity, kl, slide, lift)
            if p + 1 == primitives:
                break
            handed = kind.handed_on(guess, made).detach()
            if self.serving:
                step = self.serving.follow(frames, starts, markers, handed, hips, rotations)
                markers = step.next_seed_markers
                hips, rotations = step.translation[:, -s:], step.rotations[:, -s:]
            else:
                seed, before = handed[:, -s:], frame

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
        config, total = self.config, torch.zeros(len(Terms._fields))
        for terms in self.losses(self.frames, starts, primitives):
            loss = terms.reconstruction + config.velocity_weight * terms.velocity
            loss = loss + config.kl_weight * terms.kl + config.slide_weight * terms.slide
            loss = loss + config.lift_weight * terms.lift
            (loss / primitives).backward()
            total += torch.stack(terms).detach() / primitives
        torch.nn.utils.clip_grad_norm_(self.parameters(), 1.0)
        self.optimizer.step()
        return dict(zip(Terms._fields, total.tolist(), strict=True))

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Mean marker error in cm on fixed validation windows: posterior, prior, best of 10."""
        length, held, kind = self.window(1), self.validation, self.kind
        starts, _ = held.starts(length)
        starts = starts[:: max(1, len(starts) // 1024)]
        frame, whose = held.frame(starts, self.config.floor_origin), Whose.of(held, starts)
        told = kind.recorded(held, starts[:, None] + torch.arange(length), frame)
        seed, future = told.features.split([self.config.seed_frames, self.stride], 1)
        truth = told.markers[:, self.config.seed_frames :]
        seed = self.condition(held, starts, seed)
        generator = torch.Generator().manual_seed(1)
        latent = torch.randn(len(starts), 10, 128, generator=generator)
        drawn = kind.markers(self.model.decode(seed, latent).flatten(1, 2), whose)
        posterior = self.model.encode(seed, future).mean[:, None]
        mean = kind.markers(self.model.decode(seed, posterior)[:, 0], whose)
        error = marker_error(drawn.unflatten(1, (10, -1)), truth[:, None])
        return {
            "val/posterior_cm": float(marker_error(mean, truth).mean()),
            "val/prior_cm": float(error.mean()),
            "val/best_of_10_cm": float(error.amin(1).mean()),
        }


def marker_error(guess: Tensor, truth: Tensor) -> Tensor:
    """Mean distance per marker in cm. [..., F, 201] → [...]"""
    return 100 * (guess - truth).unflatten(-1, (-1, 3)).norm(dim=-1).mean((-1, -2))


def train_predictor(
    config: PredictorConfig,
    train: Frames,
    validation: Frames,
    folder: Path,
    minutes: float = float("inf"),
) -> bool:
    """Trains or resumes in `folder`. True when all steps are done."""
    trainer = PredictorTrainer(config, train, validation)
    trainer.run = TrainingRun(folder, config, trainer.model, trainer.optimizer)
    return trainer.run.drive(config.steps, trainer.update, trainer.validate, minutes)
