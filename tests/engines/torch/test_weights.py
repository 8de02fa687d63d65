"""Weights are read from a graph unchanged, or the graph is refused."""

from pathlib import Path

import onnx
import pytest
import torch
from onnx import helper, numpy_helper

from wayfarer.engines.torch import weights
from wayfarer.engines.torch.weights import load_step, named, output_biases
from wayfarer.errors import ArtifactError
from wayfarer.motion.layers import Gru

ORDER = torch.tensor([2, 0, 1])
PATH = Path("step_male.onnx")


LAST = "regressor.networks.{}.11"


def output_layers(*biases: torch.Tensor, products: int = 1) -> onnx.GraphProto:
    """The regressor's last layers as they are exported, their rows in another order."""
    nodes, constants = [], []
    for number, bias in enumerate(biases):
        last = LAST.format(number)
        nodes += [
            helper.make_node("Cast", [f"{last}.weight.f16"], [f"{last}.weight"], to=1),
            helper.make_node("GatherND", [f"{last}.weight", "order"], [f"rows_{number}"]),
        ]
        constants.append(numpy_helper.from_array(torch.eye(3).half().numpy(), f"{last}.weight.f16"))
        for i in range(products):
            given = [f"x_{number}_{i}", f"rows_{number}", f"bias_{number}_{i}"]
            nodes.append(helper.make_node("Gemm", given, [f"y_{number}_{i}"], transB=1))
            constants.append(numpy_helper.from_array(bias[ORDER].numpy(), given[-1]))
    return helper.make_graph(nodes, "step", [], [], constants)


def test_biases_in_the_order_of_the_graph_are_put_back_into_that_of_training():
    biases = torch.tensor([1.0, 2.0, 3.0]), torch.tensor([4.0, 5.0, 6.0])
    graph = output_layers(*biases)
    found = output_biases(graph, named(graph), ORDER, PATH)
    assert list(found) == [f"{LAST.format(n)}.bias" for n in (0, 1)]
    assert all(map(torch.equal, found.values(), biases))


@pytest.mark.parametrize("products", [0, 2])
def test_a_bias_that_cannot_be_told_is_refused(products):
    graph = output_layers(torch.ones(3), products=products)
    with pytest.raises(ArtifactError, match=r"step_male.onnx: found \d biases"):
        output_biases(graph, named(graph), ORDER, PATH)


def test_halves_come_back_as_floats_under_their_own_names():
    found = named(output_layers(torch.ones(3)))[f"{LAST.format(0)}.weight"]
    assert found.dtype == torch.float32
    assert torch.equal(found, torch.eye(3))


@pytest.fixture
def known():
    return {f"gru.{k}": v.detach() + 1 for k, v in Gru(3, 4).named_parameters()}


def test_a_network_gets_its_weights(known):
    filled = weights._filled(Gru(3, 4), "gru", known, PATH)
    assert all(torch.equal(v, known[f"gru.{k}"]) for k, v in filled.named_parameters())


def test_a_network_of_another_version_is_refused(known):
    wide = known | {"gru.from_input.weight": torch.zeros(12, 5)}
    with pytest.raises(ArtifactError, match=r"from_input.weight: found shape \[12, 5\], expected"):
        weights._filled(Gru(3, 4), "gru", wide, PATH)
    del known["gru.from_state.bias"]
    with pytest.raises(ArtifactError, match=r"from_state.bias: found nothing.*export the model"):
        weights._filled(Gru(3, 4), "gru", known, PATH)


def test_weights_without_a_place_are_refused(known):
    """A buffer of a network, for example: only parameters are read."""
    with pytest.raises(ArtifactError, match=r"gru.spread: the torch engine has no place for it"):
        weights._filled(Gru(3, 4), "gru", known | {"gru.spread": torch.ones(3)}, PATH)


def test_the_shipped_model_is_whole(models):
    step = load_step(models, "female", "float32")
    assert step.policy is not None
    assert not step.training
    assert step.floor_origin
