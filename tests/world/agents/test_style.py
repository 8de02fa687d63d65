"""What is an agent's own follows from its seed, and differs from agent to agent."""

import numpy as np

from wayfarer.world.agents.style import STRIDE, draws, manner, sets_off, stride

SEEDS = np.arange(2000, dtype=np.uint64)


def test_who_stands_sets_off_at_one_of_three_moments():
    ready = np.stack([sets_off(SEEDS, np.full(2000, chunk), 3) for chunk in range(7)])
    np.testing.assert_array_equal(ready[:3].sum(0), 1)
    np.testing.assert_array_equal(ready[3:6], ready[:3])
    assert ready[:3].sum(1).min() > 550, "as many at each"
    assert sets_off(SEEDS, np.zeros(2000, np.int64), 1).all()


def test_draws_and_manners_differ_and_stay():
    numbers = np.stack(draws(SEEDS, 4))
    assert numbers.min() >= 0 and numbers.max() < 1
    assert np.abs(np.corrcoef(numbers) - np.eye(4)).max() < 0.1
    own = manner(SEEDS[:200])
    assert own.shape == (200, 128) and abs(own.std() - 1) < 0.02
    assert np.abs(np.corrcoef(own) - np.eye(200)).max() < 0.5
    np.testing.assert_array_equal(manner(SEEDS[5:6]), own[5:6])


def test_strides_differ_at_walking_speed_and_not_at_a_run():
    shares = stride(SEEDS, np.full(2000, 1.2, np.float32))
    low, high = STRIDE
    assert low <= shares.min() < low + 0.01 and high - 0.01 < shares.max() <= high
    np.testing.assert_allclose(stride(SEEDS, np.full(2000, 1.8, np.float32)), shares / 2, atol=1e-6)
    assert not stride(SEEDS, np.full(2000, 2.5, np.float32)).any()
    numbers = np.stack([shares, *draws(SEEDS, 2)])
    assert np.abs(np.corrcoef(numbers) - np.eye(3)).max() < 0.1


def test_large_seeds_do_no_harm():
    seeds = np.array([2**64 - 1, 2**63, 0], np.uint64)
    assert np.isfinite(manner(seeds)).all()
