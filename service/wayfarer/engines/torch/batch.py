"""The inputs of a step as tensors that stay on the device, filled from arrays in host memory."""

from dataclasses import fields
from typing import Final

import numpy as np
import torch
from torch import Tensor

from wayfarer.engines.dummy import dummy_inputs
from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.engines.torch.cuda_graph_stream import CudaGraphStream
from wayfarer.motion.primitive import PrimitiveStep

INPUTS: Final = tuple(field.name for field in fields(StepInputs))


class DeviceInputs:
    """Inputs of a step on a device, filled by way of pinned memory, from which copies overlap."""

    def __init__(self, lane: CudaGraphStream, rows: int, candidates: int) -> None:
        blank = dummy_inputs(rows, candidates)
        host = {name: torch.from_numpy(getattr(blank, name)) for name in INPUTS}
        self._lane = lane
        self._host = {k: v.pin_memory() for k, v in host.items()} if lane.on_gpu else host
        self.tensors = {name: values.to(lane.device) for name, values in self._host.items()}

    def fill(self, inputs: StepInputs) -> None:
        """The first rows; the others stay what they were, for rows do not influence each other."""
        rows = len(inputs.goal)
        with self._lane.use():
            for name, values in self._host.items():
                np.copyto(values[:rows].numpy(), getattr(inputs, name))
                # on the CPU they are the same
                if self._lane.on_gpu:
                    self.tensors[name][:rows].copy_(values[:rows], non_blocking=True)


class DeviceStep:
    """A step with separate inputs and outputs. Its lane must be free when it is used."""

    def __init__(
        self, step: PrimitiveStep, lane: CudaGraphStream, rows: int, candidates: int
    ) -> None:
        self._lane = lane
        self._given = DeviceInputs(lane, rows, candidates)
        self._run = lane.record(lambda: step(**self._given.tensors))
        self._pinned: list[Tensor] = []

    def step(self, inputs: StepInputs) -> StepOutputs:
        """Runs up to as many rows as it was made for."""
        self._given.fill(inputs)
        return StepOutputs(*(v.numpy() for v in self._fetched(len(inputs.goal))))

    def _fetched(self, rows: int) -> list[Tensor]:
        results = self._run()
        if not self._lane.on_gpu:
            return [values[:rows] for values in results]
        if not self._pinned:
            self._pinned = [torch.empty_like(v, device="cpu", pin_memory=True) for v in results]
        with self._lane.use():
            for host, values in zip(self._pinned, results, strict=True):
                host[:rows].copy_(values[:rows], non_blocking=True)
        self._lane.wait()
        # Copies: the next step writes over them.
        return [host[:rows].clone() for host in self._pinned]
