"""Tensors out of a checkpoint that others wrote, without running what it pickles.

Besides tensors a checkpoint may hold pickled objects of other libraries; these are neither imported
nor run: an inert stand-in takes the place of each.
"""

from collections.abc import Sequence
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import torch
from torch import Tensor

from wayfarer.errors import ArtifactError


class _Inert:
    """Stands for any object of a class that is not a tensor's."""

    def __init__(self, *_: Any, **__: Any) -> None: ...

    def __setstate__(self, state: Any) -> None: ...


def read_tensors(path: Path, sections: Sequence[str]) -> dict[str, Tensor]:
    """Tensors by name, of the first of `sections` that the file has, or of the file itself.

    Raises ArtifactError.
    """
    try:
        strangers = torch.serialization.get_unsafe_globals_in_checkpoint(path)
        stubs = [(type("Inert", (_Inert,), {}), name) for name in strangers]
        with torch.serialization.safe_globals([*stubs]):
            state = torch.load(path, map_location="cpu", weights_only=True)
    except (OSError, ValueError, RuntimeError, UnpicklingError) as error:
        raise ArtifactError(
            f"{path}: cannot be read as a checkpoint: {error}. A plain dictionary of its tensors "
            "is read too; where you trust the file, make one with "
            f"torch.save(torch.load(old, weights_only=False)[{sections[0]!r}], new)"
        ) from error
    if not isinstance(state, dict):
        return {}
    values = next((state[name] for name in sections if name in state), state)
    found = values.items() if isinstance(values, dict) else ()
    return {str(name): value for name, value in found if isinstance(value, Tensor)}
