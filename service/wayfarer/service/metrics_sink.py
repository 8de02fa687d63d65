"""Where the loop's figures go; the service counts them for Prometheus, tests and tools do not."""

from enum import StrEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.service.streams.publications import SlowReader
from wayfarer.world.rows import Int8

Seconds = NDArray[np.float64]
"""One for each of several things."""


SET_ASIDE: Final = ("unsound", "restore", "trial", "turn")
"""Why sessions are set aside: their entries cannot be read; an error as they are restored; the
process ended while they were tried; they fail turn after turn."""


class ResumeResult(StrEnum):
    """What became of a subscription that asked to resume."""

    RESUMED = "resumed"  # nothing was lost
    GAP = "gap"  # the publications asked for are no longer held
    NEW_EPOCH = "new_epoch"  # the session has started again since


class MetricsSink:
    """Takes figures from the motion thread and from event loops; this one drops them.

    Methods of subclasses must be thread-safe, take microseconds, and never raise. Seconds
    throughout.
    """

    def step(self, seconds: float, agents: int) -> None:
        """One engine call, and for how many agents."""

    def chunks(self, lateness: Seconds, sights: Int8) -> None:
        """Chunks left together; seconds of each after its scheduled time (below 0: before it), and
        how well its agent is seen (`Sight`).
        """

    def queue(self, seconds: float) -> None:
        """Seconds of motion that wait for a subscriber, after a publication was added."""

    def drops(self, policy: SlowReader, publications: int) -> None:
        """Publications were dropped for a subscriber that was too slow."""

    def sent(self, tier: str, chunks: int, size: int) -> None:
        """A batch of chunks was sent to a stream, in a message of `size` bytes: its ring from 0 on,
        "whole" for a stream without rings, or "hidden" for those beyond the last ring, which were
        not sent.
        """

    def resume(self, result: ResumeResult) -> None:
        """A subscription asked to resume."""

    def goal_to_motion(self, seconds: float) -> None:
        """Seconds from a goal command to the scheduled time of the first chunk planned for it."""

    def refusal(self, command: str) -> None:
        """A command, by its name in `MotionService`, ended with ResourceExhausted."""

    def fault(self, stage: str) -> None:
        """An error in a stage of a turn was contained; see `world/agents/faults.py`."""

    def set_aside(self, what: str) -> None:
        """A session or a scene that could not continue was taken out for good: `what` says why."""

    def journal(self, entries: int, failed: bool) -> None:
        """The journal wrote `entries` in one transaction, or failed to."""
