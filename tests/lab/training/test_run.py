"""The end of a run by signals, and the learning rate's schedule."""

import signal
import subprocess
import sys

import pytest
import torch

from wayfarer.errors import InvalidArgument
from wayfarer_lab.training.run import cosine_rate

TRAINING = """
import os, signal, sys, warnings
import torch
from pathlib import Path
from pydantic import BaseModel
from wayfarer_lab.training.run import TrainingRun

warnings.simplefilter("error")
arguments = sys.argv[1:]

class NoConfig(BaseModel):
    pass

class Signalled(torch.autograd.Function):
    @staticmethod
    def forward(ctx, x):
        return x.clone()

    @staticmethod
    def backward(ctx, gradient):
        if run.step == 2:
            for number in numbers.split("+"):
                os.kill(os.getpid(), int(number))
        return gradient

def update():
    optimizer.zero_grad()
    Signalled.apply(model(torch.ones(1))).sum().backward()
    optimizer.step()
    return {}

before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]
for folder, numbers in zip(arguments[::2], arguments[1::2]):
    model = torch.nn.Linear(1, 1, bias=False)
    optimizer = torch.optim.SGD(model.parameters(), lr=0.1)
    run = TrainingRun(Path(folder), NoConfig(), model, optimizer)
    try:
        run.drive(10, update, dict)
    except KeyboardInterrupt:
        assert before == [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]
        print("interrupted", folder)
"""
"""Trainings in a separate process, which receives signals in the backward pass of step 3."""

SIGNALS = {
    "interrupt": [signal.SIGINT],
    "terminate": [signal.SIGTERM],
    "twice": [signal.SIGINT, signal.SIGTERM],
}


@pytest.fixture(scope="module")
def signalled(tmp_path_factory):
    """The folder with a run for each of `SIGNALS`, and what the process printed."""
    runs = tmp_path_factory.mktemp("runs")
    arguments = [
        text
        for name, signals in SIGNALS.items()
        for text in (str(runs / name), "+".join(str(int(number)) for number in signals))
    ]
    ended = subprocess.run(
        [sys.executable, "-c", TRAINING, *arguments], capture_output=True, text=True, timeout=120
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert ended.stdout.count("interrupted") == len(SIGNALS)
    return runs, ended.stdout + ended.stderr


@pytest.mark.parametrize("name", ["interrupt", "terminate"])
def test_a_signal_lets_the_step_end_and_saves_it(name, signalled):
    runs, printed = signalled
    assert torch.load(runs / name / "last.pt", weights_only=True)["step"] == 3
    assert printed.count("stopping after this step") >= 2 and "Warning" not in printed


def test_a_second_signal_breaks_the_step_off(signalled):
    runs, _ = signalled
    assert torch.load(runs / "twice" / "last.pt", weights_only=True)["step"] == 2


def test_a_short_training_reaches_its_rate():
    rates = [cosine_rate(1.0, step, 80) for step in range(80)]
    assert max(rates) == 1.0 and rates.index(max(rates)) <= 8
    assert rates[-1] < 0.01


def test_a_warm_up_of_more_than_a_tenth_is_an_error():
    with pytest.raises(InvalidArgument, match="more than a tenth of 80"):
        cosine_rate(1.0, 0, 80, warmup=200)
    assert cosine_rate(1.0, 99, 5000, warmup=100) == 1.0
