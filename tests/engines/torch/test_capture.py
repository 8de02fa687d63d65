"""A step can be captured as a CUDA graph; its calls show that even without a GPU.

During a capture, nothing may come from host memory (a new constant, a list as an index), and the
host must not read values on the device.
"""

import pytest
import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode

from tests.engines.standing import standing_inputs
from wayfarer.engines.torch.batch import INPUTS
from wayfarer.motion import constants, primitive, regressor

FROM_HOST = {torch.tensor, torch.as_tensor, torch.from_numpy, Tensor.new_tensor}
TO_HOST = {
    *(Tensor.item, Tensor.tolist, Tensor.cpu, Tensor.numpy, Tensor.__bool__, Tensor.__int__),
    *(Tensor.__float__, Tensor.nonzero, torch.nonzero, torch.masked_select, Tensor.masked_select),
}


class Watch(TorchFunctionMode):
    """Collects the calls that a capture does not allow."""

    def __init__(self):
        super().__init__()
        self.calls = []

    def __torch_function__(self, function, types, args=(), kwargs=None):
        if function in FROM_HOST | TO_HOST or not self._index_is_plain(function, args):
            self.calls.append(function.__name__)
        return function(*args, **(kwargs or {}))

    @staticmethod
    def _index_is_plain(function, args):
        if function not in (Tensor.__getitem__, Tensor.__setitem__):
            return True
        index = args[1] if isinstance(args[1], tuple) else (args[1],)
        masks = [i for i in index if isinstance(i, Tensor) and i.dtype == torch.bool]
        return not masks and not any(isinstance(i, list) for i in index)


@pytest.fixture
def on_a_gpu(monkeypatch):
    """Constants are kept, as they are on a GPU."""

    def constant(like, make, *arguments):
        return constants._kept(like.device, make, arguments)

    for module in (constants, primitive, regressor):
        monkeypatch.setattr(module, "constant", constant)
    yield
    constants._kept.cache_clear()


@pytest.mark.usefixtures("on_a_gpu")
def test_once_constants_are_kept_a_step_and_its_host_leave_each_other_alone(networks):
    step, inputs = networks.steps["male"], standing_inputs("male", 2, candidates=2)
    given = {name: torch.from_numpy(getattr(inputs, name)) for name in INPUTS}
    with torch.no_grad():
        with Watch() as first:
            step(**given)
        with Watch() as second:
            step(**given)
    assert "tensor" in first.calls
    assert second.calls == []


@pytest.mark.parametrize(
    "call",
    [
        lambda x: x + x.new_tensor([1.0, 2.0]),
        lambda x: x + torch.tensor([1.0, 2.0]),
        lambda x: x[[1, 0]],
        lambda x: x[None, [1, 0]],
        lambda x: x[x > 0],
        lambda x: x if x.sum() else -x,
        lambda x: x * x[0].item(),
    ],
)
def test_the_watch_sees_what_a_capture_would_not_allow(call):
    values = torch.ones(2)
    with Watch() as seen:
        call(values)
    assert seen.calls


@pytest.mark.usefixtures("on_a_gpu")
def test_kept_constants_give_the_same_bits(networks, monkeypatch):
    step, inputs = networks.steps["female"], standing_inputs("female", 2)
    given = {name: torch.from_numpy(getattr(inputs, name)) for name in INPUTS}
    with torch.no_grad():
        kept = step(**given)
        monkeypatch.undo()
        assert all(map(torch.equal, kept, step(**given)))
