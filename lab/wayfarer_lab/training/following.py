"""Teach a cloned policy to follow in closed loop: `wayfarer train policy-follow`.

A cloned policy has seen recorded people only. Left to itself it glides, where two answers of
recordings mean a standstill between them, and it ends beside its goal. So its own steps, feet
locked as in the service, are differentiated: the way and the facing that are asked, soles that rest
while they bear weight, a trunk that stays upright. The divergence from the cloned policy is the
price, so that people still move as recorded ones do. Slopes flow through the predictor and the
markers it hands on, not through bodies.

A second such stage makes it steady (`configs/policy_steady.toml`): users ask for something else
before a body has come to its aim, and no recorded person shows what to do then. So a part of its
agents is asked for something else in nearly every step, and departs from the policy more cheaply.
"""

import copy
from dataclasses import dataclass, fields
from math import pi
from pathlib import Path
from typing import NamedTuple

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor

from wayfarer.body.library import load_body
from wayfarer.motion.frame import canonical_frame, to_local, to_world
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.policy import Gaussian
from wayfarer.motion.quality import LEANING, Sites, take
from wayfarer.motion.trajectory import Asked, asked_of
from wayfarer.spec import FPS, GENDERS, LATENT, MARKERS, SEED_FRAMES, STEP_SECONDS
from wayfarer.world.agents.slots import Mode
from wayfarer.world.goals.steering import default_searches
from wayfarer_lab.training.cloning import load_trajectory_policy
from wayfarer_lab.training.crowd import CrowdSampler, TrainingCrowd
from wayfarer_lab.training.dataset import Frames
from wayfarer_lab.training.precision import half_precision
from wayfarer_lab.training.predictor import Serving
from wayfarer_lab.training.rotation import matrix_from_quaternion
from wayfarer_lab.training.run import TrainingRun, cosine_rate, load_predictor

NEAR_FLOOR = 0.02
"""Metres over the floor at which a sole's speed counts e⁻¹ as much as on it."""

FLOATING = 0.005
"""Metres by which the lowest sole may be off the floor."""

RUNNING = 1.9
"""m/s: an agent that is asked to go faster may leave the floor with both feet."""

STRAIGHT, BENT = 0.988, 0.93
"""Height of the waist, as a part of that over straight legs, below which a body squats: where it
stands, and elsewhere. 98 in 100 recorded frames are higher."""

ONWARD = 0.87
"""Cosine of the angle between hips and the facing that is asked above which nobody turns."""

OWN, OWN_STANDING = (default_searches()[mode].own for mode in (Mode.WALKING, Mode.STANDING))
"""Share of the noise's variance that an agent keeps for good: where it moves, and where it stands.
"""

DEAREST = 20.0
"""Maximum cost of a step: otherwise slopes of freak bodies would drown the rest."""


class FollowingConfig(BaseModel):
    """Settings of the training; files in `training/configs/`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    start_from: str = "runs/policy_cloned"  # run folder of the cloned policy, which it stays near
    predictor: str = "runs/predictor_2f_rollout"
    regressors: dict[str, str] = {g: f"runs/regressor_{g}" for g in GENDERS}
    steps: int = 1200
    agents: int = 128  # of both genders, which take turns
    horizon: int = 4  # steps through which gradients flow
    rate: float = 3e-4
    kl_weight: tuple[float, float] = (4.0, 4.0)  # of the divergence from the policy that it starts
    # from, per latent dimension: of the most and of the least patient agent
    way_weight: float = 2.0  # of a m/s off the way that is asked
    facing_weight: float = 1.0  # of 1 - cos(angle off)
    slide_weight: float = 1.5  # of a m/s of soles on the floor
    floating_weight: float = 15.0  # of a metre
    upright_weight: float = 3.0
    squat_weight: float = 25.0  # of a part of the waist's height
    seam_weight: float = 0.3  # of a m/s of change between seed and first frame
    renewal: float = 0.015  # chance at every step that an agent is replaced by a new one
    change: tuple[float, float] = (0.015, 0.015)  # chance at every step that an agent is asked for
    # something else: of the same two
    mix: dict[str, float] = {
        "walk": 0.25,
        "run": 0.04,
        "sideways": 0.13,
        "backward": 0.1,
        "start_stop": 0.16,
        "turn": 0.08,
        "standing": 0.24,
    }  # where new agents begin, see dataset.group_of
    seed: int = 0


@dataclass
class Orders:
    """Requests to A agents, world space: the same quantities as in the service."""

    goal: Tensor  # [A, 2] m
    speed: Tensor  # [A] m/s; 0: stand at the goal
    facing: Tensor  # [A, 2] unit vector, or zero: the way to the goal

    def put(self, rows: Tensor, other: "Orders") -> None:
        """Replaces those of rows [A] that are true by those of `other`, of as many agents."""
        for column in fields(self):
            mine, new = getattr(self, column.name), getattr(other, column.name)
            chosen = rows.view(-1, *(1,) * (mine.dim() - 1))
            setattr(self, column.name, torch.where(chosen, new, mine))


WALK, STRAFE, TURN = 0.40, 0.22, 0.22
"""Shares of orders; the others stand."""


def draw_orders(place: Tensor, facing: Tensor) -> Orders:
    """Random orders of agents at `place` [A, 2] who face `facing` [A, 2]."""
    count = len(place)
    kind = torch.rand(count)
    walks, strafes = kind < WALK, (kind >= WALK) & (kind < WALK + STRAFE)
    turns = (kind >= WALK + STRAFE) & (kind < WALK + STRAFE + TURN)
    ahead = torch.where(torch.rand(count) < 0.5, 0.5 * torch.randn(count), _between(count, -pi, pi))
    left = torch.where(torch.rand(count) < 0.5, 0.5 * pi, -0.5 * pi)
    aside = torch.where(torch.rand(count) < 0.33, torch.full((count,), pi), left)
    angle = torch.where(strafes, aside + 0.3 * torch.randn(count), ahead)
    goes = walks | strafes
    distance = torch.where(goes, _between(count, 0.3, 6.0), 0.12 * torch.randn(count).abs())
    speed = torch.where(
        torch.rand(count) < 0.12, _between(count, 1.8, 2.8), _between(count, 0.6, 1.7)
    )
    speed = torch.where(strafes, _between(count, 0.4, 1.25), speed) * goes
    off = torch.where(turns, _between(count, -pi, pi), 0.1 * torch.randn(count))
    return Orders(
        goal=place + rotated(facing, angle) * distance[:, None],
        speed=speed,
        facing=rotated(facing, off) * (~walks)[:, None],
    )


def _spaced(ends: tuple[float, float], count: int) -> Tensor:
    """`count` values [A] from the first to the second, each by the same factor."""
    first, last = ends
    return first * (last / first) ** torch.linspace(0, 1, count)


def _between(count: int, low: float, high: float) -> Tensor:
    return low + (high - low) * torch.rand(count)


def rotated(vectors: Tensor, angle: Tensor) -> Tensor:
    """Vectors [A, 2] turned to the left by angles [A]."""
    cos, sin = torch.cos(angle), torch.sin(angle)
    x, y = vectors.unbind(-1)
    return torch.stack([cos * x - sin * y, sin * x + cos * y], -1)


class Costs(NamedTuple):
    """Deviations of a step [A]; units as of the config's weights."""

    way: Tensor
    facing: Tensor
    slide: Tensor
    floating: Tensor
    upright: Tensor
    squat: Tensor
    seam: Tensor


def waist_height(body: MarkerBody, betas: Tensor, sites: Sites) -> Tensor:
    """Metres from the soles to the waist's markers of bodies `betas` [A, 10] on straight legs."""
    hips, unturned = torch.zeros(len(betas), 1, 3), torch.eye(3).expand(len(betas), 1, 22, 3, 3)
    markers = body.skin(body.shaped(betas), hips, unturned)[0][:, 0]
    soles = take(markers, sites.left_sole + sites.right_sole)[..., 2].amin(-1)
    return take(markers, sites.left_waist + sites.right_waist)[..., 2].mean(-1) - soles


def costs_of(
    seed: Tensor, future: Tensor, asked: Asked, sites: Sites, waist_up: Tensor, stands: Tensor
) -> Costs:
    """Costs of markers: seed [A, S, 67, 3] and future [A, F, 67, 3], canonical frame.

    `waist_up` [A] are heights from `waist_height`; agents of `stands` [A] are asked to stand.
    """
    last, end = seed[:, -1], future[:, -1]
    waist = sites.left_waist + sites.right_waist

    def centre(markers: Tensor, which: list[int]) -> Tensor:
        return take(markers, which).mean(-2)

    way = centre(end, waist) - centre(last, waist)
    across = (centre(end, sites.right_waist) - centre(end, sites.left_waist))[:, :2]
    across = across / (across.norm(dim=-1, keepdim=True) + 1e-6)
    facing = torch.stack([-across[:, 1], across[:, 0]], -1)
    trunk = centre(end, sites.chest) - centre(end, waist)
    tilt = 1 - trunk[:, 2] / (trunk.norm(dim=-1) + 1e-6)

    soles = take(torch.cat([last[:, None], future], 1), sites.left_sole + sites.right_sole)
    speed = torch.diff(soles, dim=1)[..., :2].norm(dim=-1) * FPS
    height = soles[:, 1:, :, 2]
    speed, height = speed.unflatten(-1, (2, -1)), height.unflatten(-1, (2, -1))
    on_floor = torch.exp(-((height.clamp(min=0) / NEAR_FLOOR) ** 2))
    lowest = height.argmin(-1, keepdim=True)
    rolling = (speed * on_floor).gather(-1, lowest).mean((-1, -2, -3))
    pivoting = (speed * on_floor).mean((-1, -2, -3))  # a foot may turn about one of its points
    floating = (height.amin((-1, -2)) - FLOATING).clamp(min=0).mean(-1)
    sinking = (-height).clamp(min=0).amax(-1).mean((-1, -2))
    raised = take(future, waist)[..., 2].mean((-1, -2)) / waist_up
    squat = (torch.where(stands, STRAIGHT, BENT) - raised).clamp(min=0)
    seam = ((future[:, 0] - last) - (last - seed[:, 0])).norm(dim=-1).mean(-1) * FPS
    return Costs(
        way=(way[:, :2] - asked.ways[:, 0]).norm(dim=-1) / STEP_SECONDS,
        facing=1 - (facing * asked.facings[:, 0]).sum(-1),
        slide=rolling + 0.5 * pivoting,
        floating=floating + sinking,
        upright=(tilt - LEANING).clamp(min=0),
        squat=squat,
        seam=seam,
    )


class FollowingTrainer:
    """Two crowds, one per gender, that never stop; every update continues one of them."""

    def __init__(self, config: FollowingConfig, train: Frames, validation: Frames) -> None:
        torch.manual_seed(config.seed)
        self.config = config
        self.policy = load_trajectory_policy(Path(config.start_from)).train()
        self.cloned = copy.deepcopy(self.policy).requires_grad_(False)
        self.predictor = load_predictor(Path(config.predictor), SEED_FRAMES).requires_grad_(False)
        self.predictor.uses_prior = self.predictor.has_learned_prior
        self.serving = Serving(config.regressors)
        self.bodies = {g: step.body for g, step in zip(GENDERS, self.serving.steps, strict=True)}
        self.sites = Sites.from_names(load_body("anny52", GENDERS[0]).marker_names)
        self.samplers = {g: CrowdSampler(train, body) for g, body in self.bodies.items()}
        self.trials = {g: CrowdSampler(validation, body) for g, body in self.bodies.items()}
        self.crowds = {g: s.draw(config.agents) for g, s in self.samplers.items()}
        self.orders = {g: draw_orders(c.place, c.facing) for g, c in self.crowds.items()}
        self.change = _spaced(config.change, config.agents)
        self.kl_weight = _spaced(config.kl_weight, config.agents)
        self.optimizer = torch.optim.Adam(self.policy.parameters(), lr=config.rate, fused=True)
        self.run: TrainingRun | None = None

    def advance(
        self, gender: str, crowd: TrainingCrowd, orders: Orders
    ) -> tuple[TrainingCrowd, Costs, Tensor]:
        """One step of a crowd: where it leads, its costs, KL from the cloned policy [A]."""
        hips, rotations = crowd.translation.detach(), crowd.rotations.detach()
        count = len(hips)
        frame = canonical_frame(hips[:, 0], matrix_from_quaternion(rotations[:, 0, 0]))
        turn = frame.rotation[:, :2, :2]
        seed = to_local(frame, crowd.markers.flatten(1, 2)).unflatten(1, (SEED_FRAMES, MARKERS))
        with torch.no_grad():
            goal = torch.cat([orders.goal, torch.zeros(count, 1)], -1)
            local = to_local(frame, goal[:, None])[:, 0]
            facing = (orders.facing[:, None] @ turn)[:, 0]
            asked = asked_of(seed.flatten(2), local, orders.speed, facing)
            waist_up = waist_height(self.bodies[gender], crowd.betas, self.sites)
            stands = (orders.speed == 0) & (facing[:, 1] > ONWARD)
        with half_precision():
            answer = self.policy.lead(seed.flatten(2), asked, crowd.manner)
            before = self.cloned.lead(seed.flatten(2), asked, crowd.manner)
        share = torch.where(stands, OWN_STANDING, OWN)[:, None]
        noise = torch.sqrt(1 - share) * torch.randn(count, LATENT) + torch.sqrt(share) * crowd.own
        latent = answer.mean + torch.exp(answer.log_std) * noise
        with half_precision():
            future = self.predictor.decode(seed.flatten(2), latent[:, None])[:, 0].float()
        markers = future.unflatten(-1, (MARKERS, 3))
        with torch.no_grad():
            made = self.serving.made(
                GENDERS.index(gender), crowd.markers, hips, rotations, crowd.betas, future.detach()
            )
        own = to_world(frame, markers[:, -SEED_FRAMES:].flatten(1, 2))
        own = own.unflatten(1, (SEED_FRAMES, MARKERS))
        after = TrainingCrowd(
            markers=own + (made.next_seed_markers - own).detach(),  # slopes of what was predicted
            translation=made.translation[:, -SEED_FRAMES:],
            rotations=made.rotations[:, -SEED_FRAMES:],
            betas=crowd.betas,
            manner=crowd.manner,
            own=crowd.own,
        )
        costs = costs_of(seed, markers, asked, self.sites, waist_up, stands)
        return after, costs, away(answer, before)

    def cost(self, costs: Costs, orders: Orders) -> Tensor:
        """The weighted sum [A]."""
        config = self.config
        floating = costs.floating * (orders.speed < RUNNING)
        total = (
            config.way_weight * costs.way
            + config.facing_weight * costs.facing
            + config.slide_weight * costs.slide
            + config.floating_weight * floating
            + config.upright_weight * costs.upright
            + config.squat_weight * costs.squat
            + config.seam_weight * costs.seam
        )
        return DEAREST * torch.tanh(total.nan_to_num(DEAREST) / DEAREST)

    def update(self) -> dict[str, float]:
        """One optimiser step."""
        assert self.run is not None
        config, gender = self.config, GENDERS[self.run.step % len(GENDERS)]
        for group in self.optimizer.param_groups:
            group["lr"] = cosine_rate(config.rate, self.run.step, config.steps)
        crowd, orders = self.crowds[gender], self.orders[gender]
        total, sound = torch.zeros(()), torch.ones(config.agents)
        seen = torch.zeros(len(Costs._fields) + 1)
        for _ in range(config.horizon):
            self._ask(crowd, orders)
            crowd, costs, far = self.advance(gender, crowd, orders)
            cost = self.cost(costs, orders) + self.kl_weight * far
            total = total + (sound * cost).mean() / config.horizon
            seen += torch.stack([c.detach().nan_to_num().mean() for c in (*costs, far)])
            sound = sound * (~crowd.broken()).float()  # what follows a fall teaches nothing
        self.optimizer.zero_grad()
        total.backward()
        norm = torch.nn.utils.clip_grad_norm_(self.policy.parameters(), 0.5)
        if norm.isfinite():
            self.optimizer.step()
        self._go_on(gender, crowd.detached(), orders)
        names = (*Costs._fields, "kl")
        return dict(zip(names, (seen / config.horizon).tolist(), strict=True)) | {
            "fallen": float(1 - sound.mean())
        }

    def _ask(self, crowd: TrainingCrowd, orders: Orders) -> None:
        """Asks some agents for something else; those at their goals soon are."""
        place = crowd.place.detach()
        near = ((place - orders.goal).norm(dim=-1) < 0.15) & (orders.speed > 0)
        chance = torch.where(near, self.change.clamp(min=0.1), self.change)
        other = torch.rand(self.config.agents) < chance
        orders.put(other, draw_orders(place, crowd.facing.detach()))

    def _go_on(self, gender: str, crowd: TrainingCrowd, orders: Orders) -> None:
        """Replaces broken agents, and some others, by new ones, which get requests."""
        leave = crowd.broken() | (torch.rand(self.config.agents) < self.config.renewal)
        rows = torch.nonzero(leave).squeeze(-1)
        if len(rows):
            crowd.put(rows, self.samplers[gender].draw(len(rows)))
        orders.put(leave, draw_orders(crowd.place, crowd.facing))
        self.crowds[gender] = crowd

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Mean costs of 20 steps from validation seeds."""
        state = torch.get_rng_state()
        torch.manual_seed(1)
        seen = torch.zeros(len(Costs._fields) + 1)
        for gender, sampler in self.trials.items():
            crowd = sampler.draw(self.config.agents)
            orders = draw_orders(crowd.place, crowd.facing)
            for _ in range(20):
                crowd, costs, far = self.advance(gender, crowd, orders)
                seen += torch.stack([c.nan_to_num().mean() for c in (*costs, far)]) / 40
        torch.set_rng_state(state)
        names = (*Costs._fields, "kl")
        return {f"val/{n}": v for n, v in zip(names, seen.tolist(), strict=True)}


def away(answer: Gaussian, before: Gaussian) -> Tensor:
    """KL(answer ‖ before) averaged over latent dimensions [A]."""
    mean, log_std = answer.mean.float(), answer.log_std.float()
    known, width = before.mean.float(), before.log_std.float()
    off = torch.exp(2 * log_std) + (mean - known) ** 2
    return (width - log_std + 0.5 * off * torch.exp(-2 * width) - 0.5).mean(-1)


def train_following(
    config: FollowingConfig,
    train: Frames,
    validation: Frames,
    folder: Path,
    minutes: float = float("inf"),
) -> bool:
    """Trains or resumes in `folder`. True when all steps are done."""
    trainer = FollowingTrainer(config, train, validation)
    trainer.run = TrainingRun(folder, config, trainer.policy, trainer.optimizer)
    return trainer.run.drive(config.steps, trainer.update, trainer.validate, minutes, every=100)
