import pytest
import torch

from wayfarer.errors import ArtifactError
from wayfarer.motion.policy import (
    INPUTS,
    LOG_STD,
    Condition,
    Gaussian,
    GoalPolicy,
    TrajectoryPolicy,
)
from wayfarer.spec import LATENT, MANNER, MARKERS
from wayfarer.terms import TERMS

AGENTS = 5


def asked(count=AGENTS):
    return Condition(
        goal=torch.randn(count, 3) * 4,
        target_speed=torch.rand(count),
        facing=torch.zeros(count, 2),
        term_weights=torch.rand(count, len(TERMS)),
        manner=torch.randn(count, MANNER),
    )


def seeds(frames, count=AGENTS):
    return torch.randn(count, frames, MARKERS * 3) * 0.4


def trained():
    """A policy whose output layer is not zero."""
    torch.manual_seed(0)
    policy = GoalPolicy()
    torch.nn.init.normal_(policy.output.weight)
    return policy


def test_an_untrained_policy_is_the_prior():
    pi = GoalPolicy()(seeds(2), asked())
    assert pi.mean.abs().max() == 0 and pi.log_std.abs().max() == 0
    assert pi.kl().abs().max() == 0
    noise = torch.randn(AGENTS, 3, LATENT)
    assert torch.equal(pi.sample(noise, torch.ones(AGENTS)), noise)


def test_a_narrower_policy_is_made_to_fit_its_weights():
    narrow = GoalPolicy(hidden=64)
    again = GoalPolicy.fitting(narrow.state_dict())
    again.load_state_dict(narrow.state_dict())
    seed, condition = seeds(2), asked()
    assert torch.equal(again(seed, condition).mean, narrow(seed, condition).mean)


def test_weights_of_something_else_are_refused():
    with pytest.raises(ArtifactError, match="no weights of a policy"):
        GoalPolicy.fitting({"output.1.bias": torch.zeros(1)})


def test_one_network_takes_seeds_of_one_and_two_frames():
    policy, condition = trained(), asked()
    for frames in (1, 2):
        pi = policy(seeds(frames), condition)
        assert pi.mean.shape == pi.log_std.shape == (AGENTS, LATENT)
        assert policy.value(policy.features(seeds(frames), condition)).shape == (AGENTS,)


def test_deviations_stay_within_their_limits():
    pi = trained()(100 * seeds(2), asked())
    assert pi.log_std.min() >= LOG_STD[0] and pi.log_std.max() <= LOG_STD[1]


def test_share_goes_from_prior_to_policy():
    pi = trained()(seeds(2), asked())
    noise = torch.randn(AGENTS, 2, LATENT)
    share = torch.tensor([0.0, 1.0, 0.5, 0.0, 1.0])
    z = pi.sample(noise, share)
    assert torch.equal(z[0], noise[0])
    assert torch.allclose(z[1], pi.mean[1] + pi.log_std[1].exp() * noise[1])
    assert torch.allclose(z[2], 0.5 * pi.mean[2] + (0.5 * pi.log_std[2]).exp() * noise[2])


def test_log_probability_and_kl_agree_with_torch():
    pi = Gaussian(torch.randn(3, LATENT), torch.rand(3, LATENT) - 0.5)
    normal = torch.distributions.Normal(pi.mean, pi.log_std.exp())
    z = normal.sample()
    constant = 0.5 * LATENT * torch.log(torch.tensor(2 * torch.pi))
    assert torch.allclose(pi.log_probability(z) - constant, normal.log_prob(z).sum(-1), atol=1e-3)
    prior = torch.distributions.Normal(0.0, 1.0)
    expected = torch.distributions.kl_divergence(normal, prior).mean(-1)
    assert torch.allclose(pi.kl(), expected, atol=1e-5)


def test_what_is_asked_changes_the_answer():
    policy, seed, condition = trained(), seeds(2), asked()
    before = policy(seed, condition).mean
    for change in (
        {"goal": -condition.goal},
        {"target_speed": condition.target_speed + 1},
        {"facing": torch.tensor([[1.0, 0.0]]).expand(AGENTS, 2)},
        {"term_weights": condition.term_weights.flip(-1)},
    ):
        assert (policy(seed, condition._replace(**change)).mean - before).abs().max() > 1e-3


def test_a_goal_underfoot_gives_finite_answers_and_slopes():
    policy, condition = trained(), asked()._replace(goal=torch.zeros(AGENTS, 3))
    seed = torch.zeros(AGENTS, 2, MARKERS * 3, requires_grad=True)
    policy(seed, condition).mean.sum().backward()
    assert seed.grad.isfinite().all()


def test_standardised_inputs_have_mean_0_and_deviation_1_but_for_those_that_hardly_vary():
    policy, generator = TrajectoryPolicy(16), torch.Generator().manual_seed(0)
    width = torch.linspace(0, 2, INPUTS)
    inputs = 3 + width * torch.randn(4000, INPUTS, generator=generator)
    policy.standardise(inputs)
    found = (inputs - policy.middle) / policy.spread
    assert torch.allclose(found.mean(0), torch.zeros(INPUTS), atol=1e-2)
    varies = width > 0.1
    assert torch.allclose(found[:, varies].std(0), torch.ones(()), atol=1e-3)
    assert found[:, ~varies].abs().max() < 6 and not found[:, 0].any()
