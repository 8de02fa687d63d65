import numpy as np
import pytest

from tests.world.fakes import FakeEngine
from wayfarer.engines.dummy import dummy_inputs
from wayfarer.world.stepping.new_frames import MAX_STEP_METRES, broken


@pytest.mark.parametrize("value", [np.nan, np.inf, MAX_STEP_METRES + 1])
@pytest.mark.parametrize("name", ["translation", "rotations", "next_seed_markers"])
def test_a_broken_row_is_found_alone(value, name):
    inputs = dummy_inputs(3, 2)
    outputs = FakeEngine().step("male", inputs)
    getattr(outputs, name)[1, -1, ..., 0] = value
    exploded = np.isfinite(value) and name != "translation"  # only hips can be too far away
    found = broken(inputs.seed_translation[:, -1], outputs)
    assert found.tolist() == [False, not exploded, False]
