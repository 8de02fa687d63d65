import torch
from torch import nn

from wayfarer.motion.layers import Gru


def test_gru_equals_torch():
    """Same equations as nn.GRUCell, so known results about GRUs hold."""
    torch.manual_seed(0)
    ours, theirs = Gru(5, 7), nn.GRUCell(5, 7)
    with torch.no_grad():
        theirs.weight_ih.copy_(ours.from_input.weight)
        theirs.bias_ih.copy_(ours.from_input.bias)
        theirs.weight_hh.copy_(ours.from_state.weight)
        theirs.bias_hh.copy_(ours.from_state.bias)
    frames = torch.randn(3, 4, 5)
    state = torch.zeros(3, 7)
    for t in range(4):
        state = theirs(frames[:, t], state)
    assert torch.allclose(ours.encode(frames), state, atol=1e-6)
