"""The learning rate's schedule."""

import pytest

from wayfarer.errors import InvalidArgument
from wayfarer_lab.training.run import cosine_rate


def test_a_short_training_reaches_its_rate():
    rates = [cosine_rate(1.0, step, 80) for step in range(80)]
    assert max(rates) == 1.0 and rates.index(max(rates)) <= 8
    assert rates[-1] < 0.01


def test_a_warm_up_of_more_than_a_tenth_is_an_error():
    with pytest.raises(InvalidArgument, match="more than a tenth of 80"):
        cosine_rate(1.0, 0, 80, warmup=200)
    assert cosine_rate(1.0, 99, 5000, warmup=100) == 1.0
