"""A batch on several cores: its rows are divided, and every part is computed by one thread.

A step is two thousand small operators. Threads that share each operator meet two thousand times,
and a thread that loses its core for a moment holds up the others; threads with separate rows meet
once. Rows do not depend on their batch, so the result is the same, bit for bit.
"""

import os
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from math import ceil
from typing import Final

from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.engines.padding import join, part
from wayfarer.process.processor import cores

NICENESS: Final = 5
"""Above that of the process, for threads that compute."""

LEAST: Final = 8
"""Rows that are worth a thread: fewer cost each about twice as much."""


class RowPartitioner:
    """Works on `threads` threads; with one, on the caller's own."""

    def __init__(self, threads: int) -> None:
        """`threads` 0: one per core that the process may use."""
        self.count = threads or cores()
        self._pool = ThreadPoolExecutor(self.count, "engine") if self.count > 1 else None

    def step(
        self, run: Callable[[StepInputs], StepOutputs], inputs: StepInputs, most: int
    ) -> StepOutputs:
        """`run` on equal parts of `most` rows or fewer, as many for each thread.

        Safe to call from several threads at once.
        """
        rows = len(inputs.goal)
        threads = max(min(self.count, rows // LEAST), 1)
        count = threads * max(ceil(rows / (threads * most)), 1)
        return self.parted(run, inputs, [rows * (i + 1) // count for i in range(count)])

    def parted(
        self, run: Callable[[StepInputs], StepOutputs], inputs: StepInputs, ends: Sequence[int]
    ) -> StepOutputs:
        """`run` on parts that end at these rows, as threads come free."""
        parts = [part(inputs, a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True)]
        if self._pool is None or len(parts) == 1:
            return join([run(p) for p in parts])
        # In order of the calls: a second call's parts begin as the first call's threads get free.
        return join(list(self._pool.map(run, parts)))

    def sizes(self, of_one: tuple[int, ...]) -> tuple[int, ...]:
        """Sizes of batches, ascending, from the sizes that suit one thread."""
        return (*of_one, *(of_one[-1] * count for count in range(2, self.count + 1)))


def give_way(more: int = NICENESS) -> None:
    """Makes the calling thread, and threads that it starts, run after the others of the process.

    `more`: niceness added to its own.

    A thread that holds Python's lock and waits for a core delays all others that need the lock,
    so a thread that computes for long without the lock comes last.
    """
    if sys.platform == "linux":  # on other systems it would apply to the whole process
        thread = threading.get_native_id()
        niceness = os.getpriority(os.PRIO_PROCESS, thread) + more
        os.setpriority(os.PRIO_PROCESS, thread, min(niceness, 19))
