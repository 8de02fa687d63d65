import numpy as np

from wayfarer.spec import LATENT
from wayfarer.world.stepping.noise import latents

SEEDS = np.array([0, 1, 2**64 - 1], np.uint64)
CHUNKS = np.array([0, 5, 2**40])


def test_a_row_does_not_depend_on_its_batch():
    together = latents(SEEDS, CHUNKS, 4)
    for row in range(3):
        alone = latents(SEEDS[row : row + 1], CHUNKS[row : row + 1], 4)
        np.testing.assert_array_equal(together[row], alone[0])


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
