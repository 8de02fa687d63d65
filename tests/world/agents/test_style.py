"""An agent's traits follow from its seed, and differ from agent to agent."""

import numpy as np
import pytest

from wayfarer.world.agents.style import sets_off, style_of

SEEDS = np.arange(2000, dtype=np.uint64)


def test_who_stands_sets_off_at_one_of_three_moments():
    ready = np.stack([sets_off(SEEDS, np.full(2000, chunk), 3) for chunk in range(7)])
    np.testing.assert_array_equal(ready[:3].sum(0), 1)
    np.testing.assert_array_equal(ready[3:6], ready[:3])
    assert ready[:3].sum(1).min() > 550, "as many at each"
    assert sets_off(SEEDS, np.zeros(2000, np.int64), 1).all()


@pytest.mark.parametrize(("draw", "size"), [("own_noise", 128), ("manner", 8)])
def test_what_an_agent_draws_once_differs_and_stays(draw, size):
    own = getattr(style_of(SEEDS), draw)
    assert own.shape == (2000, size)
    assert np.abs(np.cov(own.T) - np.eye(size)).max() < 0.15 and np.abs(own.mean(0)).max() < 0.1
    np.testing.assert_array_equal(getattr(style_of(SEEDS[5:6]), draw), own[5:6])
    assert getattr(style_of(SEEDS[:0]), draw).shape == (0, size)


def test_large_seeds_do_no_harm():
    seeds = np.array([2**64 - 1, 2**63, 0], np.uint64)
    found = style_of(seeds)
    assert np.isfinite(found.manner).all() and np.isfinite(found.own_noise).all()
