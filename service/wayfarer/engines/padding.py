"""Rows of a batch: padded to sizes that an engine knows, cut, taken apart and joined."""

from collections.abc import Sequence
from dataclasses import fields
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from wayfarer.engines.engine import StepInputs, StepOutputs

Columns = TypeVar("Columns", StepInputs, StepOutputs)


def whole(least: int, most: int, sizes: tuple[int, ...], full: int) -> int:
    """Number of rows to take of `most`, of which `least` are due; `sizes` of batches ascend.

    Takes a multiple of `full`, at which a row costs least: others fill it instead of padding. No
    more of them than that, since they will fill later batches. The few rows beyond a multiple wait
    for the next batch if others fill that one, or if they would need much padding.
    """
    filled = min(most, sizes[-1]) // full * full
    if least > filled and (least > sizes[-1] or most - filled >= full):
        return filled or sizes[-1]
    if filled >= least:
        return -(-least // full) * full
    room = next(size for size in sizes if size >= least)
    is_waste = room - least > max(full // 2, least - filled)
    return filled if filled and is_waste else min(room, most)


def fitting(rows: int, sizes: tuple[int, ...]) -> int:
    """The smallest of `sizes` (ascending) that holds the rows, or `rows` if none does."""
    return next((size for size in sizes if size >= rows), rows)


def pad(inputs: StepInputs, sizes: tuple[int, ...]) -> StepInputs:
    """Repeat the last row up to the next of `sizes` (ascending), which the engine has warmed."""
    rows = len(inputs.goal)
    size = fitting(rows, sizes)
    if size == rows:
        return inputs
    return pick(inputs, np.minimum(np.arange(size), rows - 1))


def pick(columns: Columns, rows: NDArray[np.int64]) -> Columns:
    """A copy of some rows."""
    return type(columns)(**{f.name: getattr(columns, f.name)[rows] for f in fields(columns)})


def cut(outputs: StepOutputs, rows: int) -> StepOutputs:
    """The first `rows` rows: drop the padding."""
    return StepOutputs(**{f.name: getattr(outputs, f.name)[:rows] for f in fields(StepOutputs)})


def part(inputs: StepInputs, start: int, end: int) -> StepInputs:
    """Rows from `start` to `end`; all of them are not copied."""
    if (start, end) == (0, len(inputs.goal)):
        return inputs
    return StepInputs(**{f.name: getattr(inputs, f.name)[start:end] for f in fields(StepInputs)})


def join(parts: Sequence[StepOutputs]) -> StepOutputs:
    """The rows of all parts, one part after the other; a single part is not copied."""
    if len(parts) == 1:
        return parts[0]
    return StepOutputs(
        **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(StepOutputs)}
    )
