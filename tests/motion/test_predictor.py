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
