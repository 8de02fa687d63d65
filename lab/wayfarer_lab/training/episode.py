"""One episode of many agents: observations, actions and rewards until each arrived or broke."""

from typing import Literal, NamedTuple

import torch
from torch import Tensor

from wayfarer.errors import InvalidArgument
from wayfarer.motion.policy import Condition, Gaussian, GoalPolicy
from wayfarer_lab.training import reward
from wayfarer_lab.training.environment import AgentBatch, GoalEnvironment, State, take
from wayfarer_lab.training.ppo import (
    PpoSettings,
    SampleBatch,
    advantages,
    evaluate,
    normalised,
    padded,
)

GoalCredit = Literal["episode", "approach"]
"""Which primitives r_goal (Eq. 9) is credited to: all of the episode, as the paper has it, or those
that came closer to the goal than any before them."""


class Episode(NamedTuple):
    """T primitives of A agents. Fields [N, …] hold the samples of `alive`, in its order."""

    state: State  # [N, …]
    latent: Tensor  # [N, 128]
    policy: Gaussian  # [N, 128] that drew them
    values: Tensor  # [T, A] of the critic
    rewards: Tensor  # [T, A, R] in the order of `reward.REWARDS`
    to_goal: Tensor  # [1 + T, A] Eq. 9 of the least distance so far, from the start on
    alive: Tensor  # [T, A] the agent was going when the primitive began
    future: Tensor  # [A] the critic's value of the end of agents that ran out of time; others: 0
    closest: Tensor  # [A] metres, least distance to the goal at the end of a primitive
    reached: Tensor  # [A]
    steps: Tensor  # [A] primitives until the goal was first reached; of the others, the limit
    broken: Tensor  # [A]
    hips: Tensor  # [1 + T, A, 3] at the start and after each primitive; NaN when no longer going


@torch.no_grad()
def simulate(
    environment: GoalEnvironment,
    policy: GoalPolicy,
    agents: AgentBatch,
    primitives: int,
    together: int = 1,
) -> Episode:
    """Steps agents until each has reached its goal or has broken, for at most `primitives` steps.

    Latents are drawn from the policy. Consecutive `together` agents continue until all of them have
    arrived or broken: the paper's simulation of clones.
    """
    task, count = environment.task, len(agents.gender)
    rows = torch.arange(count)
    values, alive = torch.zeros(primitives, count), torch.zeros(primitives, count, dtype=torch.bool)
    rewards = torch.zeros(primitives, count, len(reward.FUNCTIONS_OF_A_STEP))
    hips = torch.full((1 + primitives, count, 3), torch.nan)
    hips[0] = agents.translation[:, -1]
    closest = torch.full((count,), torch.inf)
    nearest = (agents.goal - agents.translation[:, -1])[:, :2].norm(dim=-1)
    to_goal = reward.goal(nearest, task.area, task.reached).repeat(1 + primitives, 1)
    reached, broken = torch.zeros(count, dtype=torch.bool), torch.zeros(count, dtype=torch.bool)
    steps = torch.full((count,), primitives)
    samples: list[tuple[Tensor, ...]] = []
    for t in range(primitives):
        state = environment.observe(agents)
        distribution, _, value = evaluate(policy, *state)
        noise = torch.randn_like(distribution.mean)[:, None]
        latent = distribution.sample(noise, torch.ones(len(rows)))[:, 0]
        agents, feedback = environment.step(agents, latent)
        samples.append((state.seed, *state.condition, latent, *distribution))
        values[t, rows], alive[t, rows], rewards[t, rows] = value, True, feedback.rewards
        hips[1 + t, rows] = feedback.hips
        sound = ~feedback.broken
        closest[rows] = torch.where(
            sound, torch.minimum(closest[rows], feedback.distance), closest[rows]
        )
        nearest = torch.minimum(nearest, closest)
        to_goal[1 + t :] = reward.goal(nearest, task.area, task.reached)
        there = sound & (feedback.distance <= task.reached)
        steps[rows[there & ~reached[rows]]] = t + 1
        reached[rows] |= there
        broken[rows] = feedback.broken
        ended = (reached | broken).unflatten(0, (-1, together)).all(-1)
        going = sound & ~ended.repeat_interleave(together)[rows]
        agents, rows = take(agents, going), rows[going]
        if not len(rows):
            break
    future = torch.zeros(count)
    if len(rows):
        future[rows] = evaluate(policy, *environment.observe(agents))[2]
    # Eq. 9 counts for all primitives of the episode
    of_all = reward.goal(closest, task.area, task.reached).expand(primitives, -1)
    seeds, *fields = zip(*samples, strict=True)
    seed = torch.cat([padded(s, max(x.shape[1] for x in seeds)) for s in seeds])
    *asked, latent, mean, log_std = map(torch.cat, fields)
    return Episode(
        state=State(seed, Condition(*asked)),
        latent=latent,
        policy=Gaussian(mean, log_std),
        values=values,
        rewards=torch.cat([rewards, of_all[..., None]], -1) * alive[..., None],
        to_goal=to_goal,
        alive=alive,
        future=future,
        closest=closest,
        reached=reached,
        steps=steps,
        broken=broken,
        hips=hips,
    )


def samples_of(
    episode: Episode,
    weights: Tensor,
    arrival: float | None,
    settings: PpoSettings,
    clones: int = 1,
    credit: GoalCredit = "episode",
) -> SampleBatch:
    """What PPO learns from. `weights` [R] are those of Eq. 4.

    Rewards are taken as shares of the most there is, and returns as (1 - γ) of their sum: 0…1, so
    that the critic's values neither depend on γ nor on the weights. After its last primitive, a
    broken body gets nothing, so that falling costs all future reward. A body that ran out of time
    gets what the critic expects, and a body that arrived gets `arrival`, the share of all reward
    from then on. (Every reward is positive: without it, ending early by arriving would be a loss,
    and agents would learn to dawdle.) With `arrival` None nothing comes after the last primitive,
    as in Eq. 13. Consecutive `clones` agents belong to one simulation.

    Credit by `approach`: r_goal of the least distance so far is paid from each primitive on, so a
    primitive earns its addition to that at once, and a fall costs all that was earned. Earlier
    earnings are known when a primitive begins; leaving them out of the return, as a baseline,
    changes the expected gradient as little as the critic does. The rest shows which primitive
    brought an agent closer, whereas a whole episode's r_goal is the same for all of them.
    """
    shares = weights / weights.sum()
    scale = 1 - settings.discount
    if arrival is None:
        if credit == "approach":
            raise InvalidArgument("credit by approach needs the value of arrival", "goal_credit")
        scalar = episode.rewards @ shares * scale
        after = torch.zeros_like(episode.future)
    elif credit == "episode":
        scalar = episode.rewards @ shares * scale
        after = torch.where(episode.reached, arrival, episode.future)
    else:
        of_goal = shares[-1]
        scalar = episode.rewards[..., :-1] @ shares[:-1] * scale
        scalar = scalar + of_goal * episode.to_goal.diff(dim=0)
        after = torch.where(episode.reached, arrival * (1 - of_goal), episode.future)
        after = torch.where(episode.broken, -of_goal * episode.to_goal[-1], after)
    advantage, returns = advantages(
        scalar, episode.values, episode.alive, after, settings.discount, settings.gae
    )
    return SampleBatch(
        seed=episode.state.seed,
        condition=episode.state.condition,
        latent=episode.latent,
        old=episode.policy,
        advantage=normalised(advantage, episode.alive, settings.normalised_over, clones),
        returns=returns[episode.alive],
    )
