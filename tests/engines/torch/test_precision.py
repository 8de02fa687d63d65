"""Lower precision applies only to networks, and is reset afterwards."""

import numpy as np
import pytest
import torch

from tests.engines.standing import standing_inputs
from wayfarer.engines.torch.engine import TorchEngine, load_networks
from wayfarer.engines.torch.precision import networks_in, products
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.motion.regressor import BodyRegressor

GENDER = "male"
ROWS = 6


def kind_of_products() -> str:
    return torch.backends.cuda.matmul.fp32_precision


def test_in_bfloat16_it_is_millimetres_off(models, networks):
    inputs = standing_inputs(GENDER, ROWS)
    mixed = TorchEngine(load_networks(models, "cpu", "bfloat16"), batch_sizes=(8,))
    expected = TorchEngine(networks, batch_sizes=(8,)).step(GENDER, inputs)
    off = np.abs(mixed.step(GENDER, inputs).next_seed_markers - expected.next_seed_markers)
    assert 0 < np.median(off) < 0.002
    assert off.max() < 0.02
    assert mixed.kind == "torch-bf16"


@pytest.fixture
def seen(models, monkeypatch):
    """How matrices are multiplied in the parts of a TF32 step: {part: kinds}."""
    found: dict[str, set[str]] = {}

    def watch(owner, name):
        method = getattr(owner, name)

        def watched(*given):
            found.setdefault(name, set()).add(kind_of_products())
            return method(*given)

        monkeypatch.setattr(owner, name, watched)

    watch(MarkerPredictor, "decode")
    watch(BodyRegressor, "correct")
    watch(MarkerBody, "blend")
    watch(MarkerBody, "shaped")
    watch(PrimitiveStep, "_choose")
    engine = TorchEngine(load_networks(models, "cpu", "tf32"), batch_sizes=(1,))
    engine.step(GENDER, standing_inputs(GENDER, 1))
    return found


def test_tf32_is_for_products_of_networks(seen):
    networks = {"decode", "correct"}
    assert {name for name, kinds in seen.items() if kinds == {"tf32"}} == networks
    assert all(kinds == {"ieee"} for name, kinds in seen.items() if name not in networks)


def test_how_others_multiply_is_left_as_it_was():
    before = kind_of_products()
    with pytest.raises(ValueError, match="stop"), products("tf32"):
        assert kind_of_products() == "tf32"
        raise ValueError("stop")
    assert kind_of_products() == before


def test_coordinates_are_exact_though_the_process_asked_for_tf32(networks, monkeypatch):
    seen = []
    blend = MarkerBody.blend
    monkeypatch.setattr(
        MarkerBody, "blend", lambda *given: (seen.append(kind_of_products()), blend(*given))[1]
    )
    with products("tf32"):
        TorchEngine(networks, batch_sizes=(1,)).step(GENDER, standing_inputs(GENDER, 1))
        assert kind_of_products() == "tf32"
    assert set(seen) == {"ieee"}


def test_products_of_bfloat16_networks_are_in_bfloat16():
    layer = torch.nn.Linear(4, 4)
    with networks_in("bfloat16", torch.device("cpu")):
        assert layer(torch.zeros(1, 4)).dtype == torch.bfloat16
    assert layer(torch.zeros(1, 4)).dtype == torch.float32
