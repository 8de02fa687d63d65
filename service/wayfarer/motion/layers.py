"""Small network parts that train fast on a CPU and export to plain ONNX operators."""

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn


class Mlp(nn.Sequential):
    """Linear layers, each followed by tanh. sizes = [in, hidden…, out]."""

    def __init__(self, sizes: Sequence[int]) -> None:
        layers: list[nn.Module] = []
        for i, o in pairwise(sizes):
            layers += [nn.Linear(i, o), nn.Tanh()]
        super().__init__(*layers)


class ResidualBlock(nn.Module):
    """x + two fully connected layers with ReLU."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.first = nn.Linear(size, size)
        self.second = nn.Linear(size, size)

    def forward(self, x: Tensor) -> Tensor:
        """[..., size] → same."""
        return x + torch.relu(self.second(torch.relu(self.first(x))))


class Gru(nn.Module):
    """A gated recurrent unit from plain matrix products (Cho et al. 2014, as torch.nn.GRUCell).

    Written out because (1) exporters have got `nn.GRU` silently wrong (onnxscript#2852), and
    (2) a constant part of the input, a condition, can be multiplied once and added to the gates.
    """

    def __init__(self, inputs: int, hidden: int) -> None:
        super().__init__()
        self.hidden = hidden
        self.from_input = nn.Linear(inputs, 3 * hidden)
        self.from_state = nn.Linear(hidden, 3 * hidden)

    def step(self, gates: Tensor, state: Tensor) -> Tensor:
        """Next state [..., H] from the input's share of the gates [..., 3H] and the state."""
        reset_x, update_x, new_x = gates.chunk(3, -1)
        reset_h, update_h, new_h = self.from_state(state).chunk(3, -1)
        reset = torch.sigmoid(reset_x + reset_h)
        update = torch.sigmoid(update_x + update_h)
        new = torch.tanh(new_x + reset * new_h)
        return new + update * (state - new)

    def encode(self, frames: Tensor) -> Tensor:
        """Final state [..., H] after frames [..., T, inputs], from a zero state."""
        first, *others = frames.unbind(-2)
        state = self.begin(self.from_input(first))
        for frame in others:
            state = self.step(self.from_input(frame), state)
        return state

    def begin(self, gates: Tensor) -> Tensor:
        """`step` from a zero state, of which nothing need be multiplied."""
        reset_x, update_x, new_x = gates.chunk(3, -1)
        reset_h, update_h, new_h = self.from_state.bias.chunk(3)
        reset = torch.sigmoid(reset_x + reset_h)
        update = torch.sigmoid(update_x + update_h)
        new = torch.tanh(new_x + reset * new_h)
        return new - update * new
