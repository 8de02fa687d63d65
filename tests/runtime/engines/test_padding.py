import numpy as np
import pytest

from tests.runtime.fakes import FakeEngine
from wayfarer.runtime.engines.padding import cut, join, pad, part
from wayfarer.runtime.engines.resting import resting_inputs


@pytest.mark.parametrize(("rows", "padded"), [(1, 1), (2, 4), (4, 4), (5, 8), (9, 9)])
def test_padding_repeats_the_last_row_up_to_the_next_size(rows, padded):
    inputs = resting_inputs(rows, 2)
    inputs.goal[:, 0] = np.arange(rows)
    full = pad(inputs, (1, 4, 8))
    assert full.goal[:, 0].tolist() == [min(i, rows - 1) for i in range(padded)]
    assert full.noise.shape[:2] == (padded, 2)
    outputs = cut(FakeEngine().step("male", full), rows)
    assert len(outputs.translation) == len(outputs.choice) == rows


def test_parts_joined_are_the_whole():
    inputs = resting_inputs(5, 2)
    inputs.goal[:, 0] = np.arange(5)
    engine = FakeEngine()
    whole = engine.step("male", inputs)
    parts = [engine.step("male", part(inputs, a, b)) for a, b in ((0, 2), (2, 5))]
    assert np.array_equal(join(parts).translation, whole.translation)
    assert part(inputs, 0, 5) is inputs
