"""Settings of `wayfarer train`: a config file, and options that replace its values."""

import pytest

from wayfarer.errors import InvalidArgument
from wayfarer_lab.training.cli import read_config
from wayfarer_lab.training.predictor import PredictorConfig


def test_values_can_be_set_in_place_of_the_configs() -> None:
    changes = ("steps=800", "rate=3e-4", "compile=true", "start_from=runs/base")
    config = read_config(PredictorConfig, "paper/predictor_2f", changes)
    assert (config.steps, config.rate, config.compile) == (800, 3e-4, True)
    assert config.start_from == "runs/base"
    usual = read_config(PredictorConfig, "paper/predictor_2f")
    assert config.mix == usual.mix
    assert usual.steps != 800


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("steps", "'steps' is not NAME=VALUE"),
        ("mix.walk=1", "is not NAME=VALUE"),
        ("stepps=1", "allowed keys"),
        ("steps=many", "allowed keys"),
    ],
)
def test_what_cannot_be_set_is_named(change, told) -> None:
    with pytest.raises(InvalidArgument, match=told):
        read_config(PredictorConfig, "predictor_2f", (change,))
