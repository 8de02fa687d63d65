import pytest
import torch

from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.spec import LATENT, MARKERS


@pytest.fixture(params=[1, 2])
def predictor(request):
    torch.manual_seed(0)
    return MarkerPredictor(request.param).eval()


def test_shapes_follow_the_seed_length(predictor):
    seed = torch.randn(3, predictor.seed_frames, MARKERS * 3)
    future = predictor.decode(seed, torch.randn(3, 4, LATENT))
    assert future.shape == (3, 4, 10 - predictor.seed_frames, MARKERS * 3)
    posterior = predictor.encode(seed, future[:, 0])
    assert posterior.mean.shape == posterior.log_variance.shape == (3, LATENT)


def test_candidates_do_not_influence_each_other(predictor):
    seed, latent = torch.randn(3, predictor.seed_frames, MARKERS * 3), torch.randn(3, 4, LATENT)
    together = predictor.decode(seed, latent)
    alone = predictor.decode(seed[1:2], latent[1:2, 2:3])
    assert torch.allclose(together[1:2, 2:3], alone, atol=1e-5)


def test_kl_is_zero_for_the_prior_and_grows_away_from_it():
    from wayfarer.motion.predictor import Posterior

    zero = torch.zeros(2, LATENT)
    assert torch.allclose(Posterior(zero, zero).kl(), torch.zeros(2))
    assert (Posterior(zero + 1, zero).kl() == 0.5).all()
    assert (Posterior(zero, zero - 2).kl() > 0).all()


def test_a_prior_that_is_n_0_i_may_be_left_out(predictor):
    seed, latent = torch.randn(2, predictor.seed_frames, 201), torch.randn(2, 3, LATENT)
    assert not predictor.has_learned_prior
    expected = predictor.decode(seed, latent)
    predictor.uses_prior = False
    assert torch.equal(predictor.decode(seed, latent), expected)
    predictor.prior[1].bias.data[0] = 0.5
    assert predictor.has_learned_prior


def test_latents_are_counted_from_the_learned_prior(predictor):
    """Shifting the prior shifts what a latent stands for; the posterior moves against it."""
    seed, latent = torch.randn(3, predictor.seed_frames, MARKERS * 3), torch.randn(3, 1, LATENT)
    future = torch.randn(3, predictor.new_frames, MARKERS * 3)
    plain, posterior = predictor.decode(seed, latent), predictor.encode(seed, future)
    with torch.no_grad():
        predictor.prior[1].bias[:LATENT] = 0.5
        predictor.prior[1].bias[LATENT:] = torch.log(torch.tensor(2.0))
    assert torch.allclose(predictor.decode(seed, (latent - 0.5) / 2), plain, atol=1e-5)
    shifted = predictor.encode(seed, future)
    assert torch.allclose(shifted.mean, (posterior.mean - 0.5) / 2, atol=1e-5)
    halved = posterior.log_variance - 2 * torch.log(torch.tensor(2.0))
    assert torch.allclose(shifted.log_variance, halved, atol=1e-5)
