"""PPO against examples worked by hand, and on a problem small enough to be solved here."""

import math

import pytest
import torch

from wayfarer.errors import InvalidArgument
from wayfarer.motion.policy import Condition, Gaussian, GoalPolicy
from wayfarer.spec import LATENT, MARKERS
from wayfarer.terms import TERMS
from wayfarer_lab.training import ppo
from wayfarer_lab.training.ppo import PpoSettings, SampleBatch


def test_returns_go_back_from_the_last_step():
    """Eq. 13 by hand: γ = 0.5, rewards 1, 2, 3, and 4 is what the end is worth."""
    rewards = torch.tensor([[1.0], [2.0], [3.0]])
    values = torch.tensor([[0.5], [0.0], [1.0]])
    alive = torch.ones(3, 1, dtype=torch.bool)
    advantage, returns = ppo.advantages(rewards, values, alive, torch.tensor([4.0]), 0.5, 1.0)
    assert returns.squeeze(-1).tolist() == [3.25, 4.5, 5.0]  # 5 = 3 + 4/2, 4.5 = 2 + 5/2, …
    assert advantage.squeeze(-1).tolist() == [2.75, 4.5, 4.0]  # Eq. 14


def test_an_agent_that_ends_early_gets_nothing_of_what_comes_after():
    rewards = torch.tensor([[1.0, 1.0], [9.0, 1.0]])
    alive = torch.tensor([[True, True], [False, True]])
    advantage, returns = ppo.advantages(
        rewards, torch.full((2, 2), 0.25), alive, torch.tensor([8.0, 0.0]), 0.5, 1.0
    )
    assert returns[:, 0].tolist() == [5.0, 0.0]  # 1 + 8/2; the 9 is not its own
    assert returns[:, 1].tolist() == [1.5, 1.0]
    assert advantage[1, 0] == 0


def test_generalised_advantages_by_hand():
    """λ = 0 is the error of one step; λ = 1/2 adds a quarter (γλ) of the next one."""
    rewards, alive = torch.tensor([[1.0], [2.0]]), torch.ones(2, 1, dtype=torch.bool)
    values, after = torch.tensor([[3.0], [4.0]]), torch.tensor([6.0])
    errors = [1 + 0.5 * 4 - 3, 2 + 0.5 * 6 - 4]
    zero, _ = ppo.advantages(rewards, values, alive, after, 0.5, 0.0)
    assert zero.squeeze(-1).tolist() == errors
    half, returns = ppo.advantages(rewards, values, alive, after, 0.5, 0.5)
    assert half.squeeze(-1).tolist() == [errors[0] + 0.25 * errors[1], errors[1]]
    assert torch.equal(returns, half + values)


def test_normalised_advantages_have_mean_0_and_deviation_1():
    everyone = torch.ones(1, 4, dtype=torch.bool)
    got = ppo.normalised(torch.tensor([[1.0, 2.0, 3.0, 10.0]]), everyone)
    assert got.mean().item() == pytest.approx(0, abs=1e-6)
    assert got.std().item() == pytest.approx(1)
    assert torch.isfinite(ppo.normalised(torch.ones(1, 4), everyone)).all()


def test_advantages_are_normalised_over_the_clones_of_a_simulation_as_in_the_paper():
    """Advantages are per primitive; ended agents do not count, and a lone agent's is 0."""
    advantage = torch.tensor([[1.0, 3.0, 10.0, 50.0], [5.0, 9.0, 8.0, 0.0]])
    alive = torch.tensor([[True, True, True, True], [True, True, True, False]])
    got = ppo.normalised(advantage, alive, "clones", clones=2)
    assert got.tolist() == pytest.approx([-1, 1, -1, 1, -1, 1, 0])


def test_features_of_padded_seeds_are_those_of_the_frames_they_have():
    torch.manual_seed(0)
    policy = GoalPolicy()
    _, condition = world(3)
    one, two = torch.randn(3, 1, MARKERS * 3), torch.randn(3, 2, MARKERS * 3)
    mixed = torch.cat([ppo.padded(one[:2], 2), two[2:]])
    got, _, value = ppo.evaluate(policy, mixed, condition)
    short, _, short_value = ppo.evaluate(policy, one, condition)
    long, _, long_value = ppo.evaluate(policy, two, condition)
    assert torch.allclose(value, torch.cat([short_value[:2], long_value[2:]]), atol=1e-3)
    assert torch.allclose(got.mean, torch.cat([short.mean[:2], long.mean[2:]]), atol=1e-3)
    assert torch.isfinite(value).all()


@pytest.mark.parametrize(
    ("ratio", "advantage", "expected"),
    [(1.5, 2.0, -2.4), (0.5, 2.0, -1.0), (1.5, -2.0, 3.0), (0.5, -2.0, 1.6)],
)
def test_the_surrogate_is_clipped_as_in_eq_15(ratio, advantage, expected):
    got = ppo.policy_loss(torch.tensor([ratio]), torch.tensor([advantage]), clip=0.2)
    assert got.item() == pytest.approx(expected)


def test_a_column_of_values_is_refused_instead_of_broadcast():
    with pytest.raises(InvalidArgument, match=r"\(3, 1\)"):
        ppo.value_loss(torch.zeros(3, 1), torch.zeros(3))
    assert ppo.value_loss(torch.tensor([1.0, 2.0]), torch.tensor([1.0, 4.0])).item() == 2


def test_divergence_is_that_of_torch():
    torch.manual_seed(0)
    old, new = (Gaussian(torch.randn(5, LATENT), 0.3 * torch.randn(5, LATENT)) for _ in range(2))
    normals = [torch.distributions.Normal(g.mean, g.log_std.exp()) for g in (old, new)]
    expected = torch.distributions.kl_divergence(*normals).sum(-1)
    assert torch.allclose(ppo.divergence(old, new), expected, rtol=1e-4)
    assert torch.allclose(ppo.divergence(old, old), torch.zeros(5), atol=1e-5)


def test_robust_is_psi():
    assert ppo.robust(torch.tensor(0.0)) == 0
    assert ppo.robust(torch.tensor(1.0)).item() == pytest.approx(math.sqrt(2) - 1)


def world(count):
    """States that differ by where the goal is, 3 m around."""
    goal = torch.nn.functional.normalize(torch.randn(count, 2), dim=-1) * 3
    condition = Condition(
        goal=torch.cat([goal, torch.zeros(count, 1)], -1),
        target_speed=torch.ones(count),
        facing=torch.zeros(count, 2),
        term_weights=torch.zeros(count, len(TERMS)),
        manner=torch.zeros(count, 8),
    )
    return torch.zeros(count, 1, MARKERS * 3), condition


def played(policy, count):
    """A bandit: the latent's first two entries should point the way to the goal."""
    with torch.no_grad():
        seed, condition = world(count)
        drawn, _, value = ppo.evaluate(policy, seed, condition)
        latent = drawn.sample(torch.randn(count, 1, LATENT), torch.ones(count))[:, 0]
        reward = (latent[:, :2] * condition.goal[:, :2] / 3).sum(-1)
        going, end = torch.ones(1, count, dtype=torch.bool), torch.zeros(count)
        advantage, returns = ppo.advantages(reward[None], value[None], going, end, 0.99, 1.0)
    batch = SampleBatch(
        seed, condition, latent, drawn, ppo.normalised(advantage, going), returns[0]
    )
    return batch, float(reward.mean())


def test_all_fields_of_a_batch_are_permuted_alike():
    torch.manual_seed(0)
    batch, _ = played(GoalPolicy(), 6)
    rows = torch.tensor([4, 0, 5])
    part = batch.take(rows)
    assert torch.equal(part.latent, batch.latent[rows])
    assert torch.equal(part.returns, batch.returns[rows])
    assert torch.equal(part.condition.goal, batch.condition.goal[rows])
    assert torch.equal(part.old.log_std, batch.old.log_std[rows])
    assert part.seed.shape[0] == part.advantage.shape[0] == 3


def test_ppo_learns_which_way_to_go():
    torch.manual_seed(0)
    policy = GoalPolicy()
    settings = PpoSettings(rate=3e-4, batch=256, passes=1, kl_limit=0.5)
    optimizer = torch.optim.Adam(policy.parameters(), lr=settings.rate)
    got = []
    for _ in range(10):
        batch, reward = played(policy, 512)
        ppo.update(policy, optimizer, batch, settings)
        got.append(reward)
    assert abs(got[0]) < 0.15  # the prior knows nothing
    assert got[-1] > 0.5


def test_the_critic_learns_each_state_s_return_not_the_mean():
    torch.manual_seed(0)
    policy = GoalPolicy()
    optimizer = torch.optim.Adam(policy.parameters(), lr=1e-3)
    settings = PpoSettings(batch=128, passes=1)
    for _ in range(25):
        batch, _ = played(policy, 128)
        batch = batch._replace(returns=batch.condition.goal[:, 0] / 3)
        error = ppo.update(policy, optimizer, batch, settings)["ppo/value_loss"]
    assert error < 0.5 * float(batch.returns.var())


def test_the_actor_stops_when_it_has_moved_too_far_and_the_critic_goes_on():
    torch.manual_seed(0)
    policy = GoalPolicy()
    batch, _ = played(policy, 64)

    def now():
        with torch.no_grad():
            actor, _, value = ppo.evaluate(policy, batch.seed, batch.condition)
        return actor.mean, value

    def learn(limit):
        optimizer = torch.optim.SGD(policy.parameters(), lr=0.1)
        settings = PpoSettings(batch=64, passes=6, kl_limit=limit)
        return ppo.update(policy, optimizer, batch, settings)["ppo/updates"]

    assert learn(limit=1e-9) == 1  # of six: the first finds π where π^k was
    mean, value = now()
    assert not torch.equal(mean, batch.old.mean)
    assert learn(limit=1e-9) == 0  # and now it is away from there from the beginning
    assert torch.equal(now()[0], mean)
    assert not torch.equal(now()[1], value)
