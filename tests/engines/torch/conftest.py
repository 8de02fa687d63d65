"""Networks of the shipped model, opened once; on the CPU, as most machines have no GPU."""

import pytest

pytest.importorskip("torch")

from wayfarer.engines.onnx_engine import OnnxEngine
from wayfarer.engines.torch.engine import load_networks
from wayfarer.models.bundle import DEFAULT_MODEL, load_models


@pytest.fixture(scope="session")
def models():
    return load_models(DEFAULT_MODEL)


@pytest.fixture(scope="session")
def networks(models):
    return load_networks(models, "cpu")


@pytest.fixture(scope="session")
def onnx(models):
    return OnnxEngine(models, threads=1)
