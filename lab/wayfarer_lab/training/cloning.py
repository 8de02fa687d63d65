"""Clone the policy from recordings, in hindsight: `wayfarer train policy-clone`.

A recorded person shows by its own future what it was about to do. So a request that would have led
it there is the question (`Hindsight`), in the words of the service (`motion/trajectory.py`), and
the posterior code of what it did is the answer. Seeds are as in the service: the predictor
continues from its own bodies, led by posterior codes and, in some rows, by the policy itself, whose
errors the posterior of the recorded future then takes back (DAgger; Ross et al. 2011).

What tells people apart beside the way is their *manner* (`manners.py`). A recorded moment has that
of the seconds around it; an agent draws its own.
"""

import math
from pathlib import Path
from typing import NamedTuple

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor

from wayfarer.errors import ArtifactError
from wayfarer.motion.frame import Frame, canonical_frame, to_local
from wayfarer.motion.policy import Gaussian, TrajectoryPolicy
from wayfarer.motion.predictor import Posterior
from wayfarer.motion.trajectory import (
    EASE,
    HORIZONS,
    Asked,
    approach,
    asked_of,
    motion_of,
)
from wayfarer.spec import FPS, GENDERS, LATENT, MANNER, PRIMITIVE_FRAMES, SEED_FRAMES
from wayfarer_lab.training.dataset import Frames, PairedSampler
from wayfarer_lab.training.manners import measured, recorded
from wayfarer_lab.training.precision import half_precision
from wayfarer_lab.training.predictor import Serving
from wayfarer_lab.training.rotation import matrix_from_quaternion
from wayfarer_lab.training.run import TrainingRun, cosine_rate, load_policy, load_predictor

SWAY = 0.15
"""Seconds: width of the mean that takes the sway of a step out of a path."""

TWIST = 0.3
"""Seconds: width of the mean that takes the twist of a stride out of a facing."""

SHIFT = 1.2
"""Seconds: width of the mean of places of a standing body. Nobody asks for its shifts of weight."""

STILL = 0.12
"""m/s: hips that are slower for a stride stand."""

LATER = 0.3
"""Weight of the velocity that 1 s of way asks for beside that of .5 s, between which lies what a
service asks for in a curve."""

CORNER = round(0.4 * FPS)
"""Frames: a point a metre ahead lies in the direction that a body faces .4 s later."""

FULL_WAY = 0.6
"""Metres in a second from which a body faces its way."""

BEND = 0.6
"""Radians: in curves a body turns no farther in a second; by twice as much it turns back."""

FAR = 10.0
"""Seconds of walking to a goal that nobody stops at, and m/s that limit nobody."""

BLUR = 0.3
"""Standard deviation of the noise on a recorded manner."""

KNOWN = 8192
"""Recorded moments from which it learns the spread of its inputs."""

UNSEEN = 0.05
"""Share of the posterior's variance that the policy copies. The decoder hardly hears that noise
about a code that was found for its seed; the same noise about another code makes feet slide.
"""

TEMPERATURE = 0.5
"""The policy's standard deviation as a share of what recorded codes have about its mean. Half of
it is what the policy could not know, not what people do at random: at 1 soles slide twice as far.
"""

STRIDE = PRIMITIVE_FRAMES - SEED_FRAMES


class CloningConfig(BaseModel):
    """Settings of cloning; files in `training/configs/`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    predictor: str = "runs/predictor_2f_rollout"
    regressors: dict[str, str] = {g: f"runs/regressor_{g}" for g in GENDERS}
    hidden: int = 512
    steps: int = 4000
    batch: int = 256
    rate: float = 1e-3
    rollout: int = 6  # primitives per window; a third of the draws are shorter, for short clips
    own: float = 0.35  # share of primitives that the policy itself leads
    noise: float = 0.05  # spread of what is asked: m/s, and radians
    start_from: str = ""  # run folder of a cloned policy to continue from
    mix: dict[str, float] = {
        "walk": 0.24,
        "run": 0.04,
        "sideways": 0.15,
        "backward": 0.13,
        "start_stop": 0.14,
        "turn": 0.12,
        "standing": 0.12,
        "other": 0.06,
    }  # share of draws, see dataset.group_of
    seed: int = 0


class Hindsight:
    """What recorded people did a moment later, as a request that would have led them there.

    Their own paths would tell more than a request does: they sway and twist with each step, so a
    policy would read from them what the recorded legs did next. Asked to walk straight ahead, it
    would take a mean of all steps.
    """

    def __init__(self, frames: Frames) -> None:
        facing = frames.hips_rotation[:, :2, 1]
        facing = facing / facing.norm(dim=-1, keepdim=True).clamp(min=1e-6)
        path = torch.cat([frames.hips[:, :2], facing], -1)
        at_step, at_stride, calm = (smoothed(path, frames.run, s) for s in (SWAY, TWIST, SHIFT))
        speed = torch.zeros(len(path))
        speed[:-1] = torch.diff(at_stride[:, :2], dim=0).norm(dim=-1) * FPS
        speed = torch.where(frames.run > 1, speed, torch.zeros(()))
        moves = smoothed((speed > STILL).float()[:, None], frames.run, SHIFT / 3) > 0.01
        self.rests = speed < STILL
        self.places = torch.where(moves, at_step, calm)[:, :2]
        facing = torch.where(moves, at_stride, calm)[:, 2:]
        self.facings = facing / facing.norm(dim=-1, keepdim=True).clamp(min=1e-6)

    def asked(
        self, at: Tensor, hips: Tensor, frame: Frame, seed: Tensor, noise: float = 0.0
    ) -> Asked:
        """The wishes for bodies with hips at `hips` [B, 2] at frames `at` [B] of the recording.

        seed [B, S, 201]: their markers in `frame`. A body that has left the recorded path is sent
        back to it. `noise`: standard deviation of the request, m/s and radians.
        """
        moved, velocity = motion_of(seed)
        horizons = torch.tensor(HORIZONS[1:], device=at.device)  # before it would be the sway
        ahead, seconds = at[:, None] + horizons, horizons[None, :, None] / FPS
        turn, rest = frame.rotation[:, :2, :2], torch.zeros_like(velocity)
        ways = (self.places[ahead] - hips[:, None]) @ turn
        coasted, share = approach(velocity, rest, seconds), approach(rest, rest + 1, seconds)
        aims = (ways - coasted) / share
        aim = aims[:, 0].lerp(aims[:, 1], LATER)
        goes_on = ~self.rests[ahead[:, 1]]
        way = torch.where(goes_on[:, None], FAR * aim, ways[:, 1])
        speed = torch.where(goes_on, aim.norm(dim=-1), FAR)
        # walkers face a point a metre ahead; bodies that stand or turn back face the end at once
        facing = torch.stack([self.facings[at + CORNER], self.facings[ahead[:, 1]]], 1) @ turn
        angles = torch.atan2(-facing[..., 0], facing[..., 1])
        walks = (ways[:, 1].norm(dim=-1) / FULL_WAY).clamp(max=1)
        bends = (2 - angles[:, 1].abs() / BEND).clamp(0, 1)
        angle = angles[:, 1].lerp(angles[:, 0], walks * bends)
        way = way + torch.where(goes_on, FAR, EASE)[:, None] * noise * torch.randn_like(way)
        angle = angle + noise * torch.randn_like(angle)
        wished = torch.stack([-torch.sin(angle), torch.cos(angle)], -1)
        goal = torch.cat([way + moved, torch.zeros_like(way[:, :1])], -1)
        return asked_of(seed, goal, speed, wished)


def smoothed(values: Tensor, run: Tensor, deviation: float) -> Tensor:
    """Gaussian mean over time, `deviation` seconds wide, of values [N, C]; `run` [N] says where
    unbroken stretches end.
    """
    most = round(3 * deviation * FPS)
    ends = torch.arange(len(run), device=run.device) + run  # the same within a stretch
    ends = torch.where(run > 0, ends, -1 - torch.arange(len(run), device=run.device))
    total, weights = values.clone(), torch.ones_like(values[:, :1])
    for step in range(1, most + 1):
        weight = torch.exp(torch.tensor(-0.5 * (step / FPS / deviation) ** 2)).item()
        same = (ends[step:] == ends[:-step])[:, None].to(values.dtype) * weight
        total[:-step] += same * values[step:]
        total[step:] += same * values[:-step]
        weights[:-step] += same
        weights[step:] += same
    return total / weights


class ClonedFrames(NamedTuple):
    """Recorded frames with the questions and the manners that go with them."""

    frames: Frames
    hindsight: Hindsight
    manners: Tensor  # [N, 8] of each frame


class CloningTrainer:
    """Rollouts of the trained predictor over recordings; only the policy learns."""

    def __init__(self, config: CloningConfig, train: Frames, validation: Frames) -> None:
        torch.manual_seed(config.seed)
        self.config = config
        self.predictor = load_predictor(Path(config.predictor), SEED_FRAMES).requires_grad_(False)
        self.predictor.uses_prior = self.predictor.has_learned_prior
        self.serving = Serving(config.regressors)
        start = config.start_from
        self.policy = (
            load_trajectory_policy(Path(start)).train()
            if start
            else TrajectoryPolicy(config.hidden)
        )
        self.optimizer = torch.optim.Adam(self.policy.parameters(), lr=config.rate, fused=True)
        self.lengths = (config.rollout, max(1, config.rollout // 3))
        self.samplers = {n: PairedSampler(train, self._window(n)) for n in self.lengths}
        self.trial = PairedSampler(validation, self._window(self.lengths[-1]))
        bodies = [step.body for step in self.serving.steps]
        manners = measured(train, bodies)
        self.train, self.validation = (
            ClonedFrames(f, Hindsight(f), recorded(manners, f, bodies)) for f in (train, validation)
        )
        if not start:
            self.policy.standardise(self._inputs(self.samplers[self.lengths[-1]].draw(KNOWN)))
        self.run: TrainingRun | None = None

    def _inputs(self, starts: Tensor) -> Tensor:
        """The policy's inputs at recorded frames `starts`, in rows [N, 422]."""
        frames, hindsight, manners = self.train
        seeds = starts[:, None] + torch.arange(SEED_FRAMES)
        hips = frames.hips[seeds]
        root = matrix_from_quaternion(frames.rotations[seeds][:, 0, 0])
        frame = canonical_frame(hips[:, 0], root)
        local = to_local(frame, frames.markers[seeds].flatten(1, 2))
        seed = local.reshape(len(starts), SEED_FRAMES, -1)
        asked = hindsight.asked(starts + SEED_FRAMES - 1, hips[:, -1, :2], frame, seed)
        return self.policy.inputs(seed, asked, manners[starts])

    def _window(self, primitives: int) -> int:
        """Frames that a rollout needs, and what is asked at its last primitive."""
        return SEED_FRAMES + (primitives - 1) * STRIDE + max(HORIZONS)

    def losses(self, data: ClonedFrames, starts: Tensor, primitives: int) -> list[Tensor]:
        """KL(posterior ‖ policy) per latent dimension, by primitive; rows as of `PairedSampler`."""
        frames, hindsight, manners = data
        within = torch.arange(PRIMITIVE_FRAMES)
        begin = starts[:, None] + within[:SEED_FRAMES]
        hips, rotations = frames.hips[begin], frames.rotations[begin]
        markers = frames.markers[begin]
        found: list[Tensor] = []
        for p in range(primitives):
            at = starts + p * STRIDE
            frame = canonical_frame(hips[:, 0], matrix_from_quaternion(rotations[:, 0, 0]))
            seed = to_local(frame, markers.flatten(1, 2)).reshape(len(starts), SEED_FRAMES, -1)
            future = frames.markers[at[:, None] + within[SEED_FRAMES:]]
            local = to_local(frame, future.flatten(1, 2)).reshape(len(starts), STRIDE, -1)
            with torch.no_grad(), half_precision():
                posterior = self.predictor.encode(seed, local)
            asked = hindsight.asked(
                at + SEED_FRAMES - 1, hips[:, -1, :2], frame, seed, self.config.noise
            )
            manner = manners[at] + BLUR * torch.randn(len(at), MANNER)
            with half_precision():
                answer = self.policy.lead(seed, asked, manner)
            found.append(divergence(posterior, answer))
            if p + 1 == primitives:
                break
            with torch.no_grad():
                latent = self._latent(posterior, seed, asked, manner)
                with half_precision():
                    guess = self.predictor.decode(seed, latent[:, None])[:, 0].float()
                step = self.serving.follow(frames, starts, markers, guess, hips, rotations)
                markers = step.next_seed_markers
                hips = step.translation[:, -SEED_FRAMES:]
                rotations = step.rotations[:, -SEED_FRAMES:]
        return found

    def _latent(self, posterior: Posterior, seed: Tensor, asked: Asked, manner: Tensor) -> Tensor:
        """The latents [B, 128] that lead: the recording's or, in some rows, the policy's."""
        answer = self.policy.lead(seed, asked, manner)
        noise = torch.randn(len(seed), LATENT, device=seed.device)
        by_policy = answer.mean + torch.exp(answer.log_std) * noise
        own = torch.rand(len(seed), 1, device=seed.device) < self.config.own
        return torch.where(own, by_policy, posterior.sample())

    def update(self) -> dict[str, float]:
        """One optimiser step."""
        assert self.run is not None
        for group in self.optimizer.param_groups:
            group["lr"] = cosine_rate(self.config.rate, self.run.step, self.config.steps)
        primitives = self.lengths[int(torch.rand(()) < 0.35)]
        starts = self.samplers[primitives].draw(self.config.batch)
        found = self.losses(self.train, starts, primitives)
        loss = torch.stack([kl.mean() for kl in found]).mean()
        self.optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.policy.parameters(), 1.0)
        self.optimizer.step()
        return {"kl": float(loss.detach())}

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """The divergence on people of the validation, with their manners and with others'."""
        state = torch.get_rng_state()
        torch.manual_seed(1)
        starts, found = self.trial.draw(512), {}
        data, length = self.validation, self.lengths[-1]
        others = data.manners[torch.randperm(len(data.manners))]
        for name, manners in (("kl", data.manners), ("kl_of_others", others)):
            losses = self.losses(data._replace(manners=manners), starts, length)
            found[f"val/{name}"] = float(torch.stack([kl.mean() for kl in losses]).mean())
        torch.set_rng_state(state)
        return found


def divergence(posterior: Posterior, answer: Gaussian) -> Tensor:
    """KL(posterior ‖ policy) averaged over latent dimensions [B], of a posterior that is narrowed
    to `UNSEEN` and a policy at its natural temperature; both count from the prior.
    """
    mean, log_std = answer.mean.float(), answer.log_std.float() - math.log(TEMPERATURE)
    known = posterior.log_variance + math.log(UNSEEN)
    off = torch.exp(known) + (posterior.mean - mean) ** 2
    return (log_std - 0.5 * known + 0.5 * off * torch.exp(-2 * log_std) - 0.5).mean(-1)


def load_trajectory_policy(folder: Path) -> TrajectoryPolicy:
    """The policy of a run. Raises ArtifactError when it is the paper's kind."""
    policy = load_policy(folder)
    if not isinstance(policy, TrajectoryPolicy):
        raise ArtifactError(f"{folder}: holds a goal policy; a cloned one is needed")
    return policy


def train_cloning(
    config: CloningConfig,
    train: Frames,
    validation: Frames,
    folder: Path,
    minutes: float = float("inf"),
) -> bool:
    """Trains or resumes in `folder`. True when all steps are done."""
    trainer = CloningTrainer(config, train, validation)
    trainer.run = TrainingRun(folder, config, trainer.policy, trainer.optimizer)
    return trainer.run.drive(config.steps, trainer.update, trainer.validate, minutes)
