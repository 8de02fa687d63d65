"""GAMMA-release's networks, written for these tests from the layout of its public code.

Only the names and shapes of parameters, and the functions, are theirs. Weights are made up.
"""

import torch
from torch import nn


class Stack(nn.Module):
    """`MLP`: linear layers, each followed by the activation."""

    def __init__(self, into, sizes, activation):
        super().__init__()
        self.act = activation
        ends = [into, *sizes]
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in zip(ends, sizes, strict=False))

    def forward(self, x):
        for layer in self.layers:
            x = self.act(layer(x))
        return x


class Predictor(nn.Module):
    """`GAMMAPrimitiveVAE` of MPVAE_{1,2}frame_v4.yml; time first."""

    def __init__(self, size=201, h=256, z=128):
        super().__init__()
        self.x_enc, self.e_rnn = nn.GRU(size, h), nn.GRU(size, h)
        self.e_mlp = Stack(2 * h, [512, 256], torch.tanh)
        self.e_mu, self.e_logvar = nn.Linear(256, z), nn.Linear(256, z)
        self.drnn_mlp = Stack(h, [512, 256, h], torch.tanh)
        self.d_rnn = nn.GRUCell(size + z + h, h)
        self.d_mlp = Stack(h, [512, 256], torch.tanh)
        self.d_out = nn.Linear(256, size)

    def encode(self, x, y):
        h = self.e_mlp(torch.cat([self.x_enc(x)[1][0], self.e_rnn(y)[1][0]], -1))
        return self.e_mu(h), self.e_logvar(h)

    def decode(self, x, z, frames):
        hx = self.x_enc(x)[1][0]
        state, last, out = self.drnn_mlp(hx), x[-1], []
        for _ in range(frames):
            state = self.d_rnn(torch.cat([hx, z, last], -1), state)
            last = last + self.d_out(self.d_mlp(state))
            out.append(last)
        return torch.stack(out)


class Blocks(nn.Module):
    """`MLPBlock` of the policy."""

    def __init__(self, h, out, count, activation):
        super().__init__()
        self.layers = nn.ModuleList(Stack(h, [h, h], activation) for _ in range(count))
        self.out_fc = nn.Linear(h, out)

    def forward(self, h):
        for layer in self.layers:
            h = layer(h) + h
        return self.out_fc(h)


class Residual(Blocks):
    """`ResNetBlock` of the regressor: with a layer before."""

    def __init__(self, into, h, out, count):
        super().__init__(h, out, count, torch.relu)
        self.in_fc = nn.Linear(into, h)

    def forward(self, x):
        return super().forward(self.in_fc(x))


class Policy(nn.Module):
    """`GAMMAPolicy` of MPVAEPolicy_v0.yml; time first."""

    def __init__(self, h=512, z=128):
        super().__init__()
        leaky = nn.LeakyReLU()
        self.x_enc = nn.GRU(402, h)
        self.pnet, self.vnet = Blocks(h, 2 * z, 2, leaky), Blocks(h, 1, 2, leaky)

    def forward(self, x):
        return self.pnet(self.x_enc(x)[1][0]).chunk(2, -1)


class Regressor(nn.Module):
    """`MoshRegressor` with `use_cont`: 159 body parameters, three passes."""

    def __init__(self, h=128, blocks=10, out=159):
        super().__init__()
        self.pnet = Residual(201 + out + 10, h, out, blocks)

    def forward(self, markers, betas):
        """Parameters [N, 159]: place, 22 rotations as six numbers (3 × 2 matrices), hands."""
        xb = torch.zeros(len(markers), self.pnet.out_fc.out_features)
        for _ in range(3):
            xb = self.pnet(torch.cat([markers, xb, betas], -1)) + xb
        return xb


def save(path, model, prefix="", **others):
    state = {f"{prefix}{name}": t for name, t in model.state_dict().items()}
    torch.save({"epoch": 300, "model_state_dict": state} | others, path)
    return path
