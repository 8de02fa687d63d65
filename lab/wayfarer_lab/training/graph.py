"""What is exported: a module, what it is given, and which sizes vary."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from torch import Tensor, nn


@dataclass(frozen=True)
class ExportGraph:
    """A module to export: names and example inputs, and which axes vary."""

    module: nn.Module
    inputs: dict[str, Tensor]
    outputs: Sequence[str]
    batch: Mapping[str, tuple[str, ...]]  # input → names of its leading dynamic axes
