"""The end of a run by signals, and the learning rate's schedule."""

import os
import signal

import pytest
import torch
from pydantic import BaseModel

from wayfarer.errors import InvalidArgument
from wayfarer_lab.training.run import TrainingRun, cosine_rate


class NoConfig(BaseModel):
    """A training without settings."""


class Killed(torch.autograd.Function):
    """Receives signals in the middle of its backward pass."""

    @staticmethod
    def forward(ctx, x, signals):
        ctx.signals = signals
        return x.clone()

    @staticmethod
    def backward(ctx, gradient):
        for number in ctx.signals:
            os.kill(os.getpid(), number)
        return gradient, None


def run_killed(folder, signals):
    """A run that gets the signals in the backward pass of its third step."""
    model = torch.nn.Linear(1, 1, bias=False)
    optimizer = torch.optim.SGD(model.parameters(), lr=0.1)
    run = TrainingRun(folder, NoConfig(), model, optimizer)

    def update():
        optimizer.zero_grad()
        Killed.apply(model(torch.ones(1)), signals if run.step == 2 else ()).sum().backward()
        optimizer.step()
        return {}

    with pytest.raises(KeyboardInterrupt):
        run.drive(10, update, dict)
    return torch.load(folder / "last.pt", weights_only=True)["step"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_lets_the_step_end_and_saves_it(number, tmp_path, capfd, recwarn):
    before = signal.getsignal(number)
    assert run_killed(tmp_path, [number]) == 3
    assert signal.getsignal(number) is before
    assert not recwarn and "stopping after this step" in capfd.readouterr().out


def test_a_second_signal_breaks_the_step_off(tmp_path):
    assert run_killed(tmp_path, [signal.SIGINT, signal.SIGTERM]) == 2


def test_a_short_training_reaches_its_rate():
    rates = [cosine_rate(1.0, step, 80) for step in range(80)]
    assert max(rates) == 1.0 and rates.index(max(rates)) <= 8
    assert rates[-1] < 0.01


def test_a_warm_up_of_more_than_a_tenth_is_an_error():
    with pytest.raises(InvalidArgument, match="more than a tenth of 80"):
        cosine_rate(1.0, 0, 80, warmup=200)
    assert cosine_rate(1.0, 99, 5000, warmup=100) == 1.0
