"""Small network parts that train fast on a CPU and export to plain ONNX operators."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

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


class Gates(NamedTuple):
    """Further input of a recurrent unit's gates, after frame and state; [H] or [N, H]."""

    reset: Tensor
    update: Tensor
    new: Tensor


class Gru(nn.Module):
    """A gated recurrent unit from plain matrix products (Cho et al. 2014, as torch.nn.GRUCell).

    Written out because (1) exporters have got `nn.GRU` silently wrong (onnxscript#2852), and
    (2) a constant part of the input, a condition, can be multiplied once and added to the gates.
    Every gate has its own products, each added to the last: engines take longer to cut the
    gates out of one product than to multiply.
    """

    def __init__(self, inputs: int, hidden: int) -> None:
        super().__init__()
        self.hidden = hidden
        self.from_input = nn.Linear(inputs, 3 * hidden)
        self.from_state = nn.Linear(hidden, 3 * hidden)

    def fixed(self, condition: Tensor | None = None) -> Gates:
        """The part common to all frames: biases, and a condition's share of the gates [N, 3H]."""
        given = self.from_input.bias if condition is None else condition + self.from_input.bias
        reset, update, new = given.chunk(3, -1)
        of_reset, of_update, _ = self.from_state.bias.chunk(3)
        return Gates(reset + of_reset, update + of_update, new)

    def step(self, frame: Tensor, fixed: Gates, state: Tensor) -> Tensor:
        """Next state [N, H] from a frame [N, inputs] and the state."""
        gates = self._given(frame, fixed)
        of_reset, of_update, of_new = self.from_state.weight.chunk(3)
        bias = self.from_state.bias.chunk(3)[2]
        reset = torch.sigmoid(torch.addmm(gates.reset, state, of_reset.T))
        update = torch.sigmoid(torch.addmm(gates.update, state, of_update.T))
        new = torch.tanh(gates.new + reset * torch.addmm(bias, state, of_new.T))
        return new + update * (state - new)

    def begin(self, frame: Tensor, fixed: Gates) -> Tensor:
        """`step` from a zero state, which needs no product."""
        gates = self._given(frame, fixed)
        new = torch.tanh(gates.new + torch.sigmoid(gates.reset) * self.from_state.bias.chunk(3)[2])
        return new - torch.sigmoid(gates.update) * new

    def encode(self, frames: Tensor) -> Tensor:
        """Final state [N, H] after frames [N, T, inputs], from a zero state."""
        fixed = self.fixed()
        first, *others = frames.unbind(-2)
        state = self.begin(first, fixed)
        for frame in others:
            state = self.step(frame, fixed, state)
        return state

    def _given(self, frame: Tensor, fixed: Gates) -> Gates:
        weights = self.from_input.weight.chunk(3)
        return Gates(*(torch.addmm(g, frame, w.T) for g, w in zip(fixed, weights, strict=True)))
