"""Teach a cloned policy to follow requests in closed loop: `wayfarer train policy-follow`.

A cloned policy has seen recorded people only. Left to itself it glides where recorded people
continue in one of two ways, whose mean is standing still, and it misses its goal. So it minimises
costs of its own steps, with feet locked as in the service: deviation from the requested way and
facing, sliding soles, a leaning trunk. Divergence from the first policy has a cost, too, so that
people still move as recorded ones do. Gradients flow through the predictor and its markers, not
through bodies.

Users ask for something else before a body has come to its aim, and no recorded person shows what to
do then. So every agent gets new requests: the first agent of a crowd after about 100 steps on
average, the last agent at nearly every step (`change`). Divergence costs the last agents less. With
a `like_weight` all learn from a critic to move as recorded people do (`likeness.py`).

Costs would narrow what a policy draws, and then all people would move alike. So costs teach its
mean only; its spread follows from divergence alone.
"""

import copy
from pathlib import Path
from typing import NamedTuple

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor, nn
from torch.optim import Optimizer

from wayfarer.body.library import load_body
from wayfarer.motion.frame import canonical_frame, to_local, to_world
from wayfarer.motion.policy import Gaussian
from wayfarer.motion.quality import Sites
from wayfarer.motion.trajectory import asked_of
from wayfarer.spec import (
    GENDERS,
    LATENT,
    MARKERS,
    PRIMITIVE_FRAMES,
    SEED_FRAMES,
)
from wayfarer.world.agents.slots import Mode
from wayfarer.world.goals.steering import default_searches
from wayfarer_lab.training.cloning import load_trajectory_policy
from wayfarer_lab.training.costs import Costs, Wish, costs_of, waist_height
from wayfarer_lab.training.crowd import CrowdSampler, TrainingCrowd
from wayfarer_lab.training.dataset import Frames
from wayfarer_lab.training.likeness import Likeness
from wayfarer_lab.training.orders import Orders, draw_orders
from wayfarer_lab.training.precision import half_precision
from wayfarer_lab.training.predictor import Serving
from wayfarer_lab.training.rotation import matrix_from_quaternion
from wayfarer_lab.training.run import TrainingRun, cosine_rate, load_predictor
from wayfarer_lab.training.views import EVERY, BodyFrames, joined

RUNNING = 1.9
"""m/s: an agent that is asked to go faster may leave the floor with both feet."""

ONWARD = 0.87
"""Cosine of the angle between the hips' facing and the requested one. Above it nobody needs to
turn."""

OWN, OWN_STANDING = (default_searches()[mode].own for mode in (Mode.WALKING, Mode.STANDING))
"""Share of the noise's variance that an agent keeps for good: while it moves, and while it stands.
"""

SLOWEST = 0.25
"""m/s: deviation from the way is divided by the requested speed, clamped to between this and 1 m/s.
Undivided, standing still would cost least."""

ASIDE = 4.0
"""Weight of the way in side steps and steps backward, relative to that ahead: few were recorded
there, and a critic would slow everybody down."""

URGED = 4.0
"""Weight of the way for an agent that sets off, relative to an agent that walks."""

SETTING_OFF = 0.5
"""Share of the requested speed below which an agent counts as setting off."""

PAUSE = 0.3
"""Minimum chance at every step that a standing agent is asked for something else; for every second
agent, since in a crowd people often wait only briefly."""

SLOW_KL = 0.15
"""Factor on the weight of divergence for slow walks, which the cloned policy does not know."""

AVERAGED = 0.35
"""Share of the latest step in the mean deviation from the way, about which hips may sway."""

SWAYED = 1.6
"""Factor on the mean deviation from the way, since deviations that come and go partly cancel."""

WARMING = 300
"""Steps over which the critic's weight grows to its full value: it starts untrained."""

DEAREST = 20.0
"""Maximum cost of a step: otherwise gradients of freak bodies would drown the rest."""


class FollowingConfig(BaseModel):
    """Settings of the training; files in `training/configs/`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    start_from: str = "runs/policy_cloned"  # run folder of the cloned policy, which it stays near
    predictor: str = "runs/predictor_2f_rollout"
    regressors: dict[str, str] = {g: f"runs/regressor_{g}" for g in GENDERS}
    steps: int = 1200
    agents: int = 128  # of each gender; genders take turns
    horizon: int = 4  # steps through which gradients flow
    rate: float = 3e-4
    kl_weight: tuple[float, float] = (4.0, 4.0)  # of the divergence from the policy that it starts
    # from, per latent dimension: for the first and the last agent, spaced geometrically
    way_weight: float = 2.0  # of a m/s off the requested way
    facing_weight: float = 1.0  # of 1 - cos(angle off)
    faced_weight: float = 0.0  # of the chord of the last degrees off
    linger_weight: float = 0.0  # of a metre beside the goal, for a body that is slow there
    slide_weight: float = 1.5  # of a m/s of soles on the floor
    floating_weight: float = 15.0  # of a metre
    upright_weight: float = 3.0
    squat_weight: float = 25.0  # of a part of the waist's height
    apart_weight: float = 0.0  # of a metre from foot to foot
    short_weight: float = 0.0  # of a metre that a step is too short
    narrow_weight: float = 0.0  # of a metre that it is too narrow
    seam_weight: float = 0.3  # of a m/s of change between seed and first frame
    like_weight: float = 0.0  # of the critic's verdict, see likeness.py
    like_rate: float = 2e-4  # of the critic's own training
    renewal: float = 0.015  # chance at every step that an agent is replaced by a new one
    change: tuple[float, float] = (0.015, 0.015)  # chance at every step that an agent is asked for
    # something else: for the first and the last agent
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


def _spaced(ends: tuple[float, float], count: int) -> Tensor:
    """`count` values [A] from the first to the second, spaced geometrically."""
    first, last = ends
    return first * (last / first) ** torch.linspace(0, 1, count)


class Advance(NamedTuple):
    """A step of a crowd."""

    crowd: TrainingCrowd  # after the step
    costs: Costs  # the way in world space
    away: Tensor  # [A] KL from the policy that it starts from
    view: BodyFrames | None  # as the critic sees it


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
        self.brief = torch.arange(config.agents) % 2 == 1
        self.optimizer = torch.optim.Adam(self.policy.parameters(), lr=config.rate, fused=True)
        length = config.horizon * (PRIMITIVE_FRAMES - SEED_FRAMES) + 1
        critics = GENDERS if config.like_weight else ()
        self.likeness = {
            g: Likeness(train, self.bodies[g], self.sites, length, config.like_rate)
            for g in critics
        }
        self.strayed = {g: torch.zeros(config.agents, 2) for g in GENDERS}  # mean m/s off the way
        self.run: TrainingRun | None = None

    def learning(self) -> dict[str, nn.Module | Optimizer]:
        """Networks and optimisers that learn with the policy, by name."""
        found: dict[str, nn.Module | Optimizer] = {}
        for gender, likeness in self.likeness.items():
            found[f"critic_{gender}"] = likeness.critic
            found[f"critic_optimizer_{gender}"] = likeness.optimizer
        return found

    def advance(self, gender: str, crowd: TrainingCrowd, orders: Orders) -> Advance:
        """One step of a crowd."""
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
            wish = Wish(
                asked,
                goal=((orders.goal - crowd.place)[:, None] @ turn)[:, 0],
                speed=crowd.speed,
                waist_up=waist_height(self.bodies[gender], crowd.betas, self.sites),
                headed=orders.facing.any(-1),
                stands=~orders.goes & (facing[:, 1] > ONWARD),
                walks=orders.walks & ~orders.slow,
                straight=~orders.curves,
            )
        with half_precision():
            answer = self.policy.lead(seed.flatten(2), asked, crowd.manner)
            before = self.cloned.lead(seed.flatten(2), asked, crowd.manner)
        share = torch.where(wish.stands, OWN_STANDING, OWN)[:, None]
        noise = torch.sqrt(1 - share) * torch.randn(count, LATENT) + torch.sqrt(share) * crowd.own
        latent = answer.mean + torch.exp(answer.log_std).detach() * noise
        with half_precision():
            future = self.predictor.decode(seed.flatten(2), latent[:, None])[:, 0].float()
        markers = future.unflatten(-1, (MARKERS, 3))
        with torch.no_grad():
            made = self.serving.made(
                GENDERS.index(gender), crowd.markers, hips, rotations, crowd.betas, future.detach()
            )
        predicted = to_world(frame, markers.flatten(1, 2)).unflatten(1, markers.shape[1:3])
        own = predicted[:, -SEED_FRAMES:]
        after = TrainingCrowd(
            # places of the body that was made, gradients of the markers that were predicted
            markers=own + (made.next_seed_markers - own).detach(),
            translation=made.translation[:, -SEED_FRAMES:],
            rotations=made.rotations[:, -SEED_FRAMES:],
            betas=crowd.betas,
            manner=crowd.manner,
            own=crowd.own,
        )
        landed = to_local(frame, after.markers[:, -1])
        costs = costs_of(seed, markers, landed, wish, self.sites)
        costs = costs._replace(way=(turn @ costs.way[..., None])[..., 0])
        view = None
        if self.likeness:
            seen = slice(EVERY - 1, None, EVERY)
            view = self.likeness[gender].view(
                made.translation[:, seen], made.rotations[:, seen], crowd.betas, predicted[:, seen]
            )
        return Advance(after, costs, away(answer, before), view)

    def cost(self, costs: Costs, strayed: Tensor, orders: Orders, speed: Tensor) -> Tensor:
        """The weighted sum [A]. Bodies moved at `speed` [A] m/s before the step; their mean
        deviation from the way is `strayed` [A, 2] m/s.
        """
        config = self.config
        floating = costs.floating * (orders.speed < RUNNING)
        pace = torch.where(orders.goes, orders.speed.clamp(SLOWEST, 1.0), 1.0)
        pull = torch.where(orders.goes & ~orders.walks, ASIDE, 1.0)
        pull = torch.where(orders.walks & (speed < SETTING_OFF * orders.speed), URGED, pull)
        total = (
            config.way_weight * pull * SWAYED * strayed.norm(dim=-1) / pace
            + config.facing_weight * costs.facing
            + config.faced_weight * costs.faced
            + config.linger_weight * costs.lingers
            + config.slide_weight * costs.slide
            + config.floating_weight * floating
            + config.upright_weight * costs.upright
            + config.squat_weight * costs.squat
            + config.apart_weight * costs.apart
            + config.short_weight * costs.short
            + config.narrow_weight * costs.narrow
            + config.seam_weight * costs.seam
        )
        return DEAREST * torch.tanh(total.nan_to_num(DEAREST) / DEAREST)

    def update(self) -> dict[str, float]:
        """One optimiser step."""
        assert self.run is not None
        config, gender = self.config, GENDERS[self.run.step % len(GENDERS)]
        learning = [(self.optimizer, config.rate)]
        learning += [(like.optimizer, config.like_rate) for like in self.likeness.values()]
        for optimizer, rate in learning:
            for group in optimizer.param_groups:
                group["lr"] = cosine_rate(rate, self.run.step, config.steps)
        crowd, orders = self.crowds[gender], self.orders[gender]
        total, sound = torch.zeros(()), torch.ones(config.agents)
        seen, strayed = torch.zeros(len(Costs._fields) + 1), self.strayed[gender]
        views, same = self._first(gender, crowd), torch.ones(config.agents, dtype=torch.bool)
        for step in range(config.horizon):
            other, speed = self._ask(crowd, orders), crowd.speed.detach()
            same &= ~other | (step == 0)
            crowd, costs, far, view = self.advance(gender, crowd, orders)
            views += [view] if view else []
            strayed = torch.where(other[:, None], 0.0, strayed).lerp(costs.way, AVERAGED)
            price = self.kl_weight * torch.where(orders.slow, SLOW_KL, 1.0)
            cost = self.cost(costs, strayed, orders, speed) + price * far
            total = total + (sound * cost).mean()
            seen += torch.cat([costs.means(), far.detach().nan_to_num().mean()[None]])
            sound = sound * (~crowd.broken()).float()  # what follows a fall teaches nothing
        total = total / config.horizon
        names = (*Costs._fields, "kl")
        told = dict(zip(names, (seen / config.horizon).tolist(), strict=True))
        if views:
            judged = orders.goes & same & sound.bool()
            verdict = self.likeness[gender].judge(joined(views), judged)
            warm = min(1.0, self.run.step / WARMING)
            total = total + warm * config.like_weight * verdict.cost.mean()
            told |= {"critic_right": verdict.right, "unlike": verdict.mean}
        self.optimizer.zero_grad()
        total.backward()
        norm = torch.nn.utils.clip_grad_norm_(self.policy.parameters(), 0.5)
        if norm.isfinite():
            self.optimizer.step()
        self.strayed[gender] = strayed.detach().nan_to_num()
        self._go_on(gender, crowd.detached(), orders)
        return told | {"fallen": float(1 - sound.mean())}

    def _first(self, gender: str, crowd: TrainingCrowd) -> list[BodyFrames]:
        """The last frame before an update, where there is a critic to see it."""
        if not self.likeness:
            return []
        last = crowd.translation[:, -1:].detach(), crowd.rotations[:, -1:].detach()
        return [self.likeness[gender].view(*last, crowd.betas)]

    def _ask(self, crowd: TrainingCrowd, orders: Orders) -> Tensor:
        """Gives some agents new requests, those at their goals sooner. Returns which agents [A]."""
        place = crowd.place.detach()
        orders.follow(place)
        near = ((place - orders.goal).norm(dim=-1) < 0.15) & (orders.speed > 0)
        chance = torch.where(near, self.change.clamp(min=0.1), self.change)
        chance = torch.where(self.brief & ~orders.goes, chance.clamp(min=PAUSE), chance)
        other = torch.rand(self.config.agents) < chance
        orders.put(other, draw_orders(place, crowd.facing.detach()))
        return other

    def _go_on(self, gender: str, crowd: TrainingCrowd, orders: Orders) -> None:
        """Replaces broken agents, and some others, by new ones, which get requests."""
        leave = crowd.broken() | (torch.rand(self.config.agents) < self.config.renewal)
        rows = torch.nonzero(leave).squeeze(-1)
        if len(rows):
            crowd.put(rows, self.samplers[gender].draw(len(rows)))
            self.strayed[gender][rows] = 0.0
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
                crowd, costs, far, _ = self.advance(gender, crowd, orders)
                seen += torch.cat([costs.means(), far.nan_to_num().mean()[None]]) / 40
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
    trainer.run = TrainingRun(folder, config, trainer.policy, trainer.optimizer, trainer.learning())
    return trainer.run.drive(config.steps, trainer.update, trainer.validate, minutes, every=100)
