"""What is an agent's own follows from its seed, and differs from agent to agent."""

import numpy as np

from wayfarer.world.agents.style import manner, sets_off

SEEDS = np.arange(2000, dtype=np.uint64)


def test_who_stands_sets_off_at_one_of_three_moments():
    ready = np.stack([sets_off(SEEDS, np.full(2000, chunk), 3) for chunk in range(7)])
    np.testing.assert_array_equal(ready[:3].sum(0), 1)
    np.testing.assert_array_equal(ready[3:6], ready[:3])
    assert ready[:3].sum(1).min() > 550, "as many at each"
    assert sets_off(SEEDS, np.zeros(2000, np.int64), 1).all()


def test_manners_differ_and_stay():
    own = manner(SEEDS[:200])
    assert own.shape == (200, 128) and abs(own.std() - 1) < 0.02
    assert np.abs(np.corrcoef(own) - np.eye(200)).max() < 0.5
    np.testing.assert_array_equal(manner(SEEDS[5:6]), own[5:6])


def test_large_seeds_do_no_harm():
    seeds = np.array([2**64 - 1, 2**63, 0], np.uint64)
    assert np.isfinite(manner(seeds)).all()
