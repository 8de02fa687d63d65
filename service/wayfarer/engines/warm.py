"""An engine of a server: made ready before anybody waits for it."""

import time
from collections.abc import Callable, Iterable
from typing import Protocol

from wayfarer.engines.dummy import dummy_inputs
from wayfarer.engines.engine import Engine, EngineKind
from wayfarer.spec import GENDERS


class WarmEngine(Engine, Protocol):
    """An engine that says what it is, and can be made ready for sizes of batches."""

    setting: EngineKind  # what to ask `open_engine` for to get one like it
    kind: str  # the same in more detail, for logs and tables
    batch_sizes: tuple[int, ...]  # rows at a time that suit it, ascending
    full: int  # rows of a batch, or a multiple, where each costs least
    to_compile: tuple[int, ...]  # sizes whose first call takes a second; others are made of them

    def sizes_for(self, agents: int) -> tuple[int, ...]:
        """Batch sizes that up to `agents` need: up to the first size that holds them all."""
        enough = next((s for s in self.batch_sizes if s >= agents), self.batch_sizes[-1])
        return tuple(size for size in self.batch_sizes if size <= enough)

    def warm_up(
        self,
        batch_sizes: Iterable[int],
        candidates: Iterable[int],
        done: Callable[[int, int, float], None] = lambda agents, candidates, seconds: None,
    ) -> None:
        """Runs every size once, largest first, so that no later call has to allocate or compile.

        `done(agents, candidates, seconds)` is called after each; compiling does not count.
        """
        for count in sorted(set(candidates), reverse=True):
            for size in sorted(set(batch_sizes), reverse=True):
                inputs = dummy_inputs(size, count)
                for gender in GENDERS:
                    if size in self.to_compile:
                        self.step(gender, inputs)
                    started = time.perf_counter()
                    self.step(gender, inputs)
                    done(size, count, time.perf_counter() - started)
