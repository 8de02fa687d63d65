"""The place where work runs: the CPU, at once, or a stream of a GPU, as CUDA graphs recorded once.

A step is some thousand small kernels: started one by one they cost the CPU more time than the GPU.
A CUDA graph starts them all together, on the memory that it was recorded with.
"""

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any, Final, TypeVar

import torch

from wayfarer.errors import InvalidArgument

T = TypeVar("T")

WARM_UP: Final = 3
"""Runs before a recording, in which libraries choose kernels and allocate what they keep."""

_RECORDING: Final = threading.Lock()


class CudaGraphStream:
    """A device, and a separate stream on it. For one thread at a time."""

    def __init__(self, device: torch.device, background: bool = False) -> None:
        """`background`: other streams' work on the device goes first."""
        self.device = device
        self.on_gpu = device.type == "cuda"
        self._stream: Any = None
        self._pool: Any = None
        if self.on_gpu:
            self._stream = torch.cuda.Stream(device, priority=0 if background else -1)
            # Graphs of a lane never run at the same time: they may share their memory.
            self._pool = torch.cuda.graph_pool_handle()

    def use(self) -> AbstractContextManager[object]:
        """Sends torch's work to the stream within this context."""
        return torch.cuda.stream(self._stream) if self.on_gpu else nullcontext()

    def wait(self) -> None:
        """Waits until all work is done."""
        if self.on_gpu:
            self._stream.synchronize()

    def record(self, work: Callable[[], T], *generators: torch.Generator) -> Callable[[], T]:
        """Records `work`, for repeated runs on the same tensors; it must not look at their values.

        `generators`: the random generators it uses. On a GPU, `work` is run a few times at once,
        and the next run overwrites its results.
        """
        if not self.on_gpu:
            return work
        # Precision of products is set for all threads.
        with _RECORDING, torch.cuda.device(self.device):
            with self.use():
                for _ in range(WARM_UP):
                    work()
            self.wait()
            graph = torch.cuda.CUDAGraph()
            for generator in generators:
                graph.register_generator_state(generator)
            # Other lanes continue meanwhile.
            with torch.cuda.graph(
                graph, pool=self._pool, stream=self._stream, capture_error_mode="thread_local"
            ):
                result = work()

        def run() -> T:
            with self.use():
                graph.replay()
            return result

        return run


def chosen_device(name: str | None) -> torch.device:
    """The device of a name like `cuda:1`; None: the first GPU. Raises InvalidArgument for none."""
    if name is None and not torch.cuda.is_available():
        raise InvalidArgument(
            f"the engine 'torch' needs a GPU, and torch {torch.__version__} finds none here; on a "
            "CPU, 'onnxruntime' and 'openvino' are faster",
            "engine",
        )
    device = torch.device(name or "cuda")
    if device.type == "cuda" and device.index is None:
        return torch.device("cuda", torch.cuda.current_device())
    return device
