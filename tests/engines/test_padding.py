import numpy as np
import pytest

from tests.world.fakes import FakeEngine
from wayfarer.engines.dummy import dummy_inputs
from wayfarer.engines.padding import cut, join, pad, part, whole


@pytest.mark.parametrize(("rows", "padded"), [(1, 1), (2, 4), (4, 4), (5, 8), (9, 9)])
def test_padding_repeats_the_last_row_up_to_the_next_size(rows, padded):
    inputs = dummy_inputs(rows, 2)
    inputs.goal[:, 0] = np.arange(rows)
    full = pad(inputs, (1, 4, 8))
    assert full.goal[:, 0].tolist() == [min(i, rows - 1) for i in range(padded)]
    assert full.noise.shape[:2] == (padded, 2)
    outputs = cut(FakeEngine().step("male", full), rows)
    assert len(outputs.translation) == len(outputs.choice) == rows


SIZES = (1, 4, 8, 16, 32)


@pytest.mark.parametrize(
    ("due", "there", "taken"),
    [
        (1, 1, 1),
        (3, 3, 3),  # with one row of padding
        (3, 6, 4),  # or another in its place
        (3, 9, 8),  # a multiple of 8 costs least
        (3, 31, 8),  # no more: others will fill a later batch
        (9, 31, 16),
        (16, 40, 16),
        (30, 40, 32),
        (33, 40, 32),  # no batch is larger
        (17, 17, 16),  # one row is left, since otherwise half of the batch would be padding
        (14, 14, 14),  # but two rows of padding are little
        (14, 15, 15),
    ],
)
def test_a_batch_is_filled_with_those_who_are_due_soon(due, there, taken):
    assert whole(due, there, SIZES, full=8) == taken


def test_rows_that_would_pay_for_small_parts_wait_if_others_fill_the_next_batch():
    assert whole(11, 20, (4, 8, 12), full=8) == 8
    assert whole(11, 15, (4, 8, 12), full=8) == 12


def test_without_a_best_size_all_are_taken_that_fit():
    sizes = tuple(range(1, 65))
    assert [whole(n, n, sizes, full=1) for n in (1, 5, 64, 70)] == [1, 5, 64, 64]
    assert whole(5, 5, (1,), full=1) == 1


def test_parts_joined_are_the_whole():
    inputs = dummy_inputs(5, 2)
    inputs.goal[:, 0] = np.arange(5)
    engine = FakeEngine()
    whole = engine.step("male", inputs)
    parts = [engine.step("male", part(inputs, a, b)) for a, b in ((0, 2), (2, 5))]
    assert np.array_equal(join(parts).translation, whole.translation)
    assert part(inputs, 0, 5) is inputs
