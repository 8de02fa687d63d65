import numpy as np

from wayfarer.spec import LATENT
from wayfarer.world.stepping import noise
from wayfarer.world.stepping.noise import latents

SEEDS = np.array([0, 1, 2**64 - 1], np.uint64)
CHUNKS = np.array([0, 5, 2**40])


def test_a_row_does_not_depend_on_its_batch():
    together = latents(SEEDS, CHUNKS, 4)
    for row in range(3):
        alone = latents(SEEDS[row : row + 1], CHUNKS[row : row + 1], 4)
        np.testing.assert_array_equal(together[row], alone[0])


def numpys(seed, chunk, candidates):
    """The numbers that numpy draws."""
    bits = np.random.Philox(key=np.array([seed, noise._STREAM], np.uint64))
    state = bits.state
    state["state"]["counter"][1] = chunk
    bits.state = state
    return np.random.Generator(bits).standard_normal((candidates, LATENT), np.float32)


def test_it_is_what_numpy_draws_to_the_last_bit():
    """This includes numbers from the tail, 3 in 10,000."""
    seeds = np.random.default_rng(0).integers(0, 2**64, 300, np.uint64)
    chunks = np.arange(300) ** 5
    made = latents(seeds, chunks, 8)
    assert np.abs(made).max() > noise._TAIL
    for row in range(300):
        np.testing.assert_array_equal(made[row], numpys(seeds[row], chunks[row], 8))


def test_too_few_words_are_told_and_not_made_up():
    """A number may take any count of words; if they run out, all are drawn again with more."""
    made = np.empty((1, LATENT), np.float32)
    for seed in range(20):
        row, chunk = np.array([seed], np.uint64), np.zeros(1, np.int64)
        words = [np.empty(count, np.int64) for count in range(120, 168, 8)]
        told = [noise._draw(row, chunk, some, made) for some in words]
        assert not told[0] and told[-1] and told == sorted(told)
        np.testing.assert_array_equal(made, numpys(seed, 0, 1))


def test_fewer_candidates_are_the_first_of_more():
    np.testing.assert_array_equal(latents(SEEDS, CHUNKS, 8)[:, :3], latents(SEEDS, CHUNKS, 3))


def test_seeds_and_chunks_differ():
    first = latents(np.array([7, 7, 8], np.uint64), np.array([0, 1, 0]), 16).reshape(3, -1)
    assert np.abs(np.corrcoef(first) - np.eye(3)).max() < 0.1


def test_it_is_standard_normal():
    values = latents(np.arange(50, dtype=np.uint64), np.zeros(50, np.int64), 16)
    assert values.shape == (50, 16, LATENT) and values.dtype == np.float32
    assert abs(values.mean()) < 0.01
    assert abs(values.std() - 1) < 0.01
