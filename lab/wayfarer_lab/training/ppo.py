"""Proximal policy optimisation as pure functions (paper Eq. 10, 13-15; Schulman et al. 2017).

T = primitives of an episode, A = agents, N = samples: the primitives of all agents whose episode
has not ended, in order of time, then of rows.
"""

from typing import Literal, NamedTuple

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor

from wayfarer.errors import InvalidArgument
from wayfarer.motion.policy import Condition, Gaussian, GoalPolicy
from wayfarer_lab.training.precision import half_precision


class PpoSettings(BaseModel):
    """How a policy learns from one epoch's samples."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    rate: float = 3e-4
    slow_epochs: int = 0  # first epochs, at half the rate: Adam's first steps are mostly noise
    batch: int = 1024
    passes: int = 3
    discount: float = 0.99  # γ of Eq. 13
    gae: float = 1.0  # λ of generalised advantages; 1 is Eq. 14
    clip: float = 0.2  # ε of Eq. 15
    normalised_over: Literal["epoch", "clones"] = "epoch"  # what advantages are normalised over
    kl_limit: float = 0.02  # the actor stops when KL(π^k ‖ π) is larger
    value_weight: float = 1.0
    prior_weight: float = 10.0  # α of Eq. 10, which the paper does not name; GAMMA's code has 10
    max_gradient: float = 1.0


class SampleBatch(NamedTuple):
    """Samples to learn from; row n of every field is the same sample."""

    seed: Tensor  # [N, S, 201]
    condition: Condition
    latent: Tensor  # [N, 128]
    old: Gaussian  # π^k, the policy that drew them
    advantage: Tensor  # [N]
    returns: Tensor  # [N]

    def take(self, rows: Tensor) -> "SampleBatch":
        """Some samples, by index; all fields are permuted alike."""
        return SampleBatch(
            self.seed[rows],
            Condition(*(field[rows] for field in self.condition)),
            self.latent[rows],
            Gaussian(*(field[rows] for field in self.old)),
            self.advantage[rows],
            self.returns[rows],
        )


def evaluate(
    policy: GoalPolicy, seed: Tensor, condition: Condition
) -> tuple[Gaussian, Tensor, Tensor]:
    """π(z | s), features and V(s) [N]. Half precision, except for what enters a ratio: float32.

    Seeds may be `padded`.
    """
    with half_precision():
        features = _features(policy, seed, condition)
        value = policy.value(features)
    return policy.act(features.float()), features, value.float()


def padded(seed: Tensor, frames: int) -> Tensor:
    """Seeds [N, S, 201] with NaN before their first frame, so that there are `frames` frames."""
    return torch.nn.functional.pad(seed, (0, 0, frames - seed.shape[1], 0), value=torch.nan)


def _features(policy: GoalPolicy, seed: Tensor, condition: Condition) -> Tensor:
    """The policy's features [N, 512] of seeds of which some are of one frame."""
    short = seed[:, 0, 0].isnan()
    if not short.any():
        return policy.features(seed, condition)
    order, found = [], []
    for rows, first in ((torch.nonzero(short), seed.shape[1] - 1), (torch.nonzero(~short), 0)):
        chosen = rows.squeeze(-1)
        asked = Condition(*(field[chosen] for field in condition))
        found.append(policy.features(seed[chosen, first:], asked))
        order.append(chosen)
    return torch.cat(found)[torch.cat(order).argsort()]


def advantages(
    rewards: Tensor, values: Tensor, alive: Tensor, after: Tensor, discount: float, gae: float
) -> tuple[Tensor, Tensor]:
    """Advantages [T, A] and returns [T, A], zero after the end of an agent's episode.

    rewards, values [T, A]; alive [T, A] is true up to each agent's last primitive, and `after` [A]
    is the value of its end. With λ = 1, R_t = Σ γ^(τ-t) r_τ (Eq. 13, summed from the last step to
    the first) and A_t = R_t - V(s_t) (Eq. 14); with smaller λ, generalised advantages (Schulman et
    al. 2016) and R_t = A_t + V(s_t).
    """
    advantage = torch.zeros_like(rewards)
    next_value, next_advantage = after, torch.zeros_like(after)  # V(s_t+1), A_t+1
    for t in range(len(rewards) - 1, -1, -1):
        delta = rewards[t] + discount * next_value - values[t]
        next_advantage = torch.where(alive[t], delta + discount * gae * next_advantage, 0.0)
        next_value = torch.where(alive[t], values[t], after)
        advantage[t] = next_advantage
    return advantage, torch.where(alive, advantage + values, 0.0)


def normalised(
    advantage: Tensor, alive: Tensor, over: Literal["epoch", "clones"] = "epoch", clones: int = 1
) -> Tensor:
    """Advantages [T, A] of the samples `alive` [T, A] with zero mean and unit deviation: [N].

    Over all samples of the epoch, or, as in the paper and in GAMMA-release, over the `clones` of
    one simulation (agents after one another) at each primitive.
    """
    if over == "epoch":
        samples = advantage[alive]
        return (samples - samples.mean()) / (samples.std() + 1e-8)
    groups, going = (x.unflatten(1, (-1, clones)) for x in (advantage, alive.float()))
    count = going.sum(-1, keepdim=True).clamp(min=1)
    centred = going * (groups - (going * groups).sum(-1, keepdim=True) / count)
    spread = torch.sqrt((centred**2).sum(-1, keepdim=True) / count)
    return (centred / (spread + 1e-8)).flatten(1)[alive]


def policy_loss(ratio: Tensor, advantage: Tensor, clip: float) -> Tensor:
    """Eq. 15, averaged: ratio [N] of π(z|s) to π^k(z|s)."""
    clipped = ratio.clamp(1 - clip, 1 + clip)
    return -torch.minimum(ratio * advantage, clipped * advantage).mean()


def value_loss(value: Tensor, returns: Tensor) -> Tensor:
    """Second term of Eq. 10: mean of (R_t - V(s_t))². Both [N].

    Raises InvalidArgument on other shapes: [N, 1] and [N] would broadcast to [N, N], as they do in
    GAMMA-release, and teach the critic only the batch's mean.
    """
    if value.shape != returns.shape or value.ndim != 1:
        raise InvalidArgument(
            f"values {tuple(value.shape)} and returns {tuple(returns.shape)} must both be [N]"
        )
    return ((returns - value) ** 2).mean()


def divergence(old: Gaussian, new: Gaussian) -> Tensor:
    """KL(π^k ‖ π) of diagonal Gaussians, exact, summed over latent dimensions. [N]"""
    ratio = torch.exp(2 * (old.log_std - new.log_std))
    shift = (old.mean - new.mean) ** 2 * torch.exp(-2 * new.log_std)
    return 0.5 * (ratio + shift - 1 - 2 * (old.log_std - new.log_std)).sum(-1)


def robust(divergence: Tensor) -> Tensor:
    """Ψ(s) = √(1 + s²) - 1 (Eq. 1 and 10)."""
    return torch.sqrt(1 + divergence * divergence) - 1


@torch.no_grad()
def _all_features(policy: GoalPolicy, samples: SampleBatch, batch: int) -> Tensor:
    """The policy's features [N, 512] of all samples."""
    parts = torch.arange(len(samples.latent)).split(batch)
    taken = (samples.take(rows) for rows in parts)
    return torch.cat([evaluate(policy, part.seed, part.condition)[1].float() for part in taken])


def update(
    policy: GoalPolicy,
    optimizer: torch.optim.Optimizer,
    samples: SampleBatch,
    settings: PpoSettings,
) -> dict[str, float]:
    """Minimises Eq. 10 over `settings.passes` passes through the samples. Returns mean losses.

    Once KL(π^k ‖ π) exceeds `settings.kl_limit`, only the critic trains on; the actor and the
    shared encoder stay as they are.
    """
    watched: list[dict[str, float]] = []
    settled: Tensor | None = None  # [N, 512] features, once the encoder stays as it is
    for _ in range(settings.passes):
        for rows in torch.randperm(len(samples.latent)).split(settings.batch):
            part = samples.take(rows)
            if settled is None:
                now, _, value = evaluate(policy, part.seed, part.condition)
                moved = divergence(part.old, now).mean()
                if moved > settings.kl_limit:
                    settled = _all_features(policy, samples, settings.batch)
            if settled is not None:
                value = policy.value(settled[rows])
            error = value_loss(value, part.returns)
            loss = settings.value_weight * error
            if settled is None:
                log_ratio = now.log_probability(part.latent) - part.old.log_probability(part.latent)
                surrogate = policy_loss(log_ratio.exp(), part.advantage, settings.clip)
                to_prior = now.kl().mean()
                loss = loss + surrogate + settings.prior_weight * robust(to_prior)
                watched.append(
                    {
                        "ppo/surrogate": float(surrogate.detach()),
                        "ppo/kl_old": float(moved.detach()),
                        "ppo/kl_prior": float(to_prior.detach()),
                    }
                )
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(policy.parameters(), settings.max_gradient)
            optimizer.step()
    means = {k: sum(w[k] for w in watched) / len(watched) for k in (watched[0] if watched else ())}
    return means | {"ppo/updates": float(len(watched)), "ppo/value_loss": float(error.detach())}
