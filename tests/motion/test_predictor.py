import pytest
import torch

from wayfarer.errors import ArtifactError
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.spec import LATENT, MARKERS


@pytest.fixture(params=[(1, 1), (2, 1), (2, 4), (2, 8)])
def predictor(request):
    """Predictors by frames of the seed, and frames found at once."""
    torch.manual_seed(0)
    seed_frames, at_once = request.param
    return MarkerPredictor(seed_frames, at_once=at_once).eval()


def test_shapes_follow_the_seed_length(predictor):
    seed = torch.randn(3, predictor.seed_frames, MARKERS * 3)
    future = predictor.decode(seed, torch.randn(3, 4, LATENT))
    assert future.shape == (3, 4, 10 - predictor.seed_frames, MARKERS * 3)
    posterior = predictor.encode(seed, future[:, 0])
    assert posterior.mean.shape == posterior.log_variance.shape == (3, LATENT)


def test_a_network_is_made_to_fit_weights(predictor):
    again = MarkerPredictor.fitting(predictor.state_dict(), predictor.seed_frames)
    again.load_state_dict(predictor.state_dict())
    assert again.at_once == predictor.at_once


def test_weights_of_something_else_are_refused():
    with pytest.raises(ArtifactError, match="no weights of a predictor"):
        MarkerPredictor.fitting({"condition.bias": torch.zeros(1)}, 2)


def test_frames_that_are_no_multiple_are_refused():
    with pytest.raises(ValueError, match="8 frames are no multiple of 3"):
        MarkerPredictor(2, at_once=3)


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
    """Shifting the prior shifts the meaning of a latent; the posterior moves against it."""
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
