"""Both graphs of the pose prior, run by onnxruntime against torch."""

import pytest
import torch

from wayfarer_lab.onnx_files import WeightStore
from wayfarer_lab.training.export import TOLERANCE, parity, round_to_half, save_graph
from wayfarer_lab.training.pose_graphs import pose_decoder_graph, pose_encoder_graph
from wayfarer_lab.training.pose_networks import PosePrior
from wayfarer_lab.training.rotation import matrix_from_rotvec

INPUTS = {
    pose_encoder_graph: lambda n: {"rotations": matrix_from_rotvec(torch.randn(n, 21, 3))},
    pose_decoder_graph: lambda n: {"latent": torch.randn(n, 32)},
}


@pytest.mark.parametrize("make", INPUTS, ids=["encoder", "decoder"])
def test_torch_and_onnx_agree_for_any_number_of_poses(make, tmp_path):
    torch.manual_seed(0)
    graph, store = make(round_to_half(PosePrior())), WeightStore()
    save_graph(graph, tmp_path / "pose.onnx", store, contract="{}")
    store.write(tmp_path)
    for count in (1, 5):
        given = INPUTS[make](count)
        assert parity(graph.module, tmp_path / "pose.onnx", given, graph.outputs) < TOLERANCE
