import numpy as np
import pytest

from tests.runtime.fakes import FakeEngine
from wayfarer.runtime.engines.onnx_engine import resting_inputs
from wayfarer.runtime.stepping.batch import MAX_STEP_METRES, broken, cut, pad


@pytest.mark.parametrize(("rows", "padded"), [(1, 1), (2, 4), (4, 4), (5, 8), (9, 9)])
def test_padding_repeats_the_last_row_up_to_the_next_size(rows, padded):
    inputs = resting_inputs(rows, 2)
    inputs.goal[:, 0] = np.arange(rows)
    full = pad(inputs, (1, 4, 8))
    assert full.goal[:, 0].tolist() == [min(i, rows - 1) for i in range(padded)]
    assert full.noise.shape[:2] == (padded, 2)
    outputs = cut(FakeEngine().step("male", full), rows)
    assert len(outputs.translation) == len(outputs.choice) == rows


@pytest.mark.parametrize("value", [np.nan, np.inf, MAX_STEP_METRES + 1])
@pytest.mark.parametrize("name", ["translation", "rotations", "next_seed_markers"])
def test_a_broken_row_is_found_alone(value, name):
    inputs = resting_inputs(3, 2)
    outputs = FakeEngine().step("male", inputs)
    getattr(outputs, name)[1, -1, ..., 0] = value
    exploded = np.isfinite(value) and name != "translation"  # only hips can be too far away
    found = broken(inputs.seed_translation[:, -1], outputs)
    assert found.tolist() == [False, not exploded, False]
