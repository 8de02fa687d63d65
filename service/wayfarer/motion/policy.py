"""The goal policy π(Z | s): latents that bring a body to its goal (paper Sec. 3.3.1, Fig. S4).

There are two. `GoalPolicy` is the paper's: an actor and a critic over one recurrent encoder. Its
state is that of Eq. 3: the markers of the seed and, for each, the direction to the goal. Deviations
from the paper: the networks also get the distance to the goal, the target speed, the target facing
and the weights of the quality terms, so that one policy walks, strolls, stops, stands and turns.

`TrajectoryPolicy` serves. Its input is a trajectory (`trajectory.py`). It was cloned from recorded
people, whose own future shows what they were about to do.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple, Self

import torch
from torch import Tensor, nn

from wayfarer.errors import ArtifactError
from wayfarer.motion.layers import Gru
from wayfarer.motion.trajectory import HORIZONS, Asked, asked_of
from wayfarer.spec import FPS, LATENT, MANNER, MARKERS
from wayfarer.terms import POLICY_TERMS

HIDDEN = 512
BLOCKS = 2
LOG_STD = (-2.0, 0.5)
"""Limits of log σ: from nearly certain to a little wider than the prior."""

FAR = 2.0
"""Metres: distances are encoded as d / (d + FAR), which resolves near ones and levels off."""


class Condition(NamedTuple):
    """Requests to the agents, in the canonical frame of their seed."""

    goal: Tensor  # [A, 3]
    target_speed: Tensor  # [A] m/s
    facing: Tensor  # [A, 2] horizontal unit vector, or zero: the way to the goal
    term_weights: Tensor  # [A, T]
    manner: Tensor  # [A, 8] ~ N(0, I): whose way to move it is


class Gaussian(NamedTuple):
    """A diagonal normal distribution of latents; both [A, 128]."""

    mean: Tensor
    log_std: Tensor

    def kl(self) -> Tensor:
        """KL(π ‖ N(0, I)) averaged over latent dimensions. [A]"""
        return 0.5 * (torch.exp(2 * self.log_std) + self.mean**2 - 1 - 2 * self.log_std).mean(-1)

    def log_probability(self, latent: Tensor) -> Tensor:
        """Log π(latent), without its constant, summed over dimensions. [A]"""
        standard = (latent - self.mean) * torch.exp(-self.log_std)
        return -(0.5 * standard**2 + self.log_std).sum(-1)

    def sample(self, noise: Tensor, share: Tensor) -> Tensor:
        """Latents [A, K, 128] from standard normal noise; share [A]: 0 the prior, 1 the policy.

        Between 0 and 1, mean and log σ are scaled: z = p·μ + σ^p ⊙ noise.
        """
        share = share[:, None, None]
        return share * self.mean[:, None] + torch.exp(share * self.log_std[:, None]) * noise


def state(seed: Tensor, goal: Tensor) -> Tensor:
    """The state of Eq. 3 [A, S, 402]: seed [A, S, 201] and the directions to the goal [A, 3]."""
    # s = (X, (g - X) / |g - X|)
    ways = goal[:, None, None] - seed.unflatten(-1, (MARKERS, 3))
    ways = ways / torch.sqrt((ways * ways).sum(-1, keepdim=True) + 1e-6)
    return torch.cat([seed, ways.flatten(-2)], -1)


class LeakyBlock(nn.Module):
    """x + two fully connected layers with leaky ReLU (Fig. S4)."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(size, size), nn.LeakyReLU(), nn.Linear(size, size), nn.LeakyReLU()
        )

    def forward(self, x: Tensor) -> Tensor:
        """[..., size] → same."""
        return x + self.layers(x)


class GoalPolicy(nn.Module):
    """Serves seeds of one and of two frames alike."""

    def __init__(self, hidden: int = HIDDEN) -> None:
        """`hidden`: width of its layers, H; 512 in the paper."""
        super().__init__()
        self.encoder = Gru(2 * MARKERS * 3, hidden)
        self.condition = nn.Linear(1 + 2 + 1 + 2 + len(POLICY_TERMS), hidden)
        self.actor = nn.Sequential(*(LeakyBlock(hidden) for _ in range(BLOCKS)))
        self.output = nn.Linear(hidden, 2 * LATENT)
        self.critic = nn.Sequential(
            *(LeakyBlock(hidden) for _ in range(BLOCKS)), nn.Linear(hidden, 1)
        )
        nn.init.zeros_(self.output.weight)  # begins as the prior N(0, I)
        nn.init.zeros_(self.output.bias)

    @classmethod
    def fitting(cls, weights: Mapping[str, Tensor]) -> Self:
        """A new policy with the width of these weights. Raises ArtifactError for others."""
        if "condition.bias" not in weights:
            raise ArtifactError("these are no weights of a policy: no 'condition.bias'")
        return cls(len(weights["condition.bias"]))

    def forward(self, seed: Tensor, condition: Condition) -> Gaussian:
        """Seed [A, S, 201], canonical frame → the distribution of latents."""
        return self.act(self.features(seed, condition))

    def act(self, features: Tensor) -> Gaussian:
        """The actor on shared features [A, H]."""
        mean, log_std = self.output(self.actor(features)).chunk(2, -1)
        low, high = LOG_STD
        return Gaussian(mean, log_std.clamp(low, high))

    def value(self, features: Tensor) -> Tensor:
        """The critic on shared features [A, H]: the expected return [A]."""
        return self.critic(features).squeeze(-1)

    def features(self, seed: Tensor, condition: Condition) -> Tensor:
        """Encoding of the state [A, H] (Eq. 3), and of the request."""
        encoded = self.encoder.encode(state(seed, condition.goal))
        way = condition.goal[:, :2]  # the canonical origin lies under the hips
        distance = torch.sqrt((way * way).sum(-1, keepdim=True) + 1e-6)
        asked = [
            distance / (distance + FAR),
            way / (distance + 0.3),  # fades where a direction means nothing
            condition.target_speed[:, None],
            condition.facing,
            condition.term_weights[:, : len(POLICY_TERMS)],
        ]
        return torch.tanh(encoded + self.condition(torch.cat(asked, -1)))


CLONED_LOG_STD = (-3.0, 0.5)
"""Limits of log σ of a cloned policy: recorded people may be surer than a rewarded one."""

VELOCITY = 0.3
"""Seconds: velocities of markers are given as the way in this time, about as long as places."""

LEAST_SPREAD = 0.01
"""Least standard deviation that an input is divided by."""

INPUTS = 2 * MARKERS * 3 + 4 * len(HORIZONS) + MANNER
"""Numbers that a cloned policy is given: markers and their velocities, a trajectory, a manner."""


class TrajectoryPolicy(nn.Module):
    """Latents that lead along a trajectory, for seeds of two frames.

    An agent's *manner* is to tell people apart (`lab/wayfarer_lab/training/manners.py`).
    """

    def __init__(self, hidden: int = HIDDEN) -> None:
        """`hidden`: width of its layers."""
        super().__init__()
        sizes = (INPUTS, hidden, hidden, hidden)
        layers: list[nn.Module] = []
        for before, after in pairwise(sizes):
            layers += [nn.Linear(before, after), nn.ELU()]
        output = nn.Linear(hidden, 2 * LATENT)
        self.net = nn.Sequential(*layers, output)
        nn.init.zeros_(output.weight)  # begins as the prior N(0, I)
        nn.init.zeros_(output.bias)
        self.middle = nn.Parameter(torch.zeros(INPUTS), requires_grad=False)  # as engines read it
        self.spread = nn.Parameter(torch.ones(INPUTS), requires_grad=False)

    def standardise(self, inputs: Tensor) -> None:
        """Learns means and standard deviations of inputs [N, 422]: markers are metres apart, and
        two steps differ by centimetres.
        """
        self.middle.copy_(inputs.mean(0))
        self.spread.copy_(inputs.std(0).clamp(min=LEAST_SPREAD))

    def forward(self, seed: Tensor, condition: Condition) -> Gaussian:
        """Seed [A, S, 201], canonical frame → the distribution of latents."""
        asked = asked_of(seed, condition.goal, condition.target_speed, condition.facing)
        return self.lead(seed, asked, condition.manner)

    def lead(self, seed: Tensor, asked: Asked, manner: Tensor) -> Gaussian:
        """As `forward`, along a given trajectory, in a manner [A, 8]."""
        inputs = (self.inputs(seed, asked, manner) - self.middle) / self.spread
        mean, log_std = self.net(inputs).chunk(2, -1)
        low, high = CLONED_LOG_STD
        return Gaussian(mean, log_std.clamp(low, high))

    @staticmethod
    def inputs(seed: Tensor, asked: Asked, manner: Tensor) -> Tensor:
        """Its inputs, in one row [A, 422]."""
        last = seed[:, -1]
        moved = (last - seed[:, 0]) * (FPS * VELOCITY)
        trajectory = torch.cat([asked.ways, asked.facings], -1).flatten(1)
        return torch.cat([last, moved, trajectory, manner], -1)


Policy = GoalPolicy | TrajectoryPolicy


def fitting_policy(weights: Mapping[str, Tensor]) -> Policy:
    """A new policy with the kind and width of these weights. Raises ArtifactError."""
    if "net.0.bias" in weights:
        inputs = weights["net.0.weight"].shape[1]
        if inputs != INPUTS or "middle" not in weights:
            raise ArtifactError(
                f"this policy has {inputs} inputs that are not standardised, instead of {INPUTS} "
                "that are: it is of an earlier build; clone it again"
            )
        return TrajectoryPolicy(len(weights["net.0.bias"]))
    return GoalPolicy.fitting(weights)
