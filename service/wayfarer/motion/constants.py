"""Small tensors of fixed numbers: indices, axes, shares of frames.

On the CPU they are made where they are used, which costs nothing, and an exporter writes them as
constants. On a GPU each would be a copy from pageable memory, which halts the stream and cannot be
captured in a CUDA graph. There each is made once, and kept.
"""

from collections.abc import Callable, Hashable, Sequence
from functools import cache

import torch
from torch import Tensor


def indices(which: Sequence[int], like: Tensor) -> Tensor:
    """Whole numbers [N], on the device of `like`."""
    return constant(like, _tensor, tuple(which), torch.int64)


def numbers(values: Sequence[float], like: Tensor) -> Tensor:
    """Numbers [N] of the type and on the device of `like`."""
    return constant(like, _tensor, tuple(values), like.dtype)


def constant(like: Tensor, make: Callable[..., Tensor], *arguments: Hashable) -> Tensor:
    """`make(*arguments)`, which is always the same, on the device of `like`."""
    if like.device.type == "cpu":
        return make(*arguments)
    return _kept(like.device, make, arguments)


@cache
def _kept(
    device: torch.device, make: Callable[..., Tensor], arguments: tuple[Hashable, ...]
) -> Tensor:
    return make(*arguments).to(device)


def _tensor(values: tuple[float, ...], dtype: torch.dtype) -> Tensor:
    return torch.tensor(values, dtype=dtype)
