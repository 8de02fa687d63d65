"""Sinks of the loop's figures: the service counts them for Prometheus, tests and tools do not."""

from enum import StrEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.runtime.streams.publications import SlowReader
from wayfarer.world.rows import Int8

Seconds = NDArray[np.float64]
"""Seconds of several things, one value each."""


SET_ASIDE: Final = ("unsound", "restore", "trial", "turn")
"""Reasons to set a session aside: its entries cannot be read, an error when it was restored, the
process ended while it was tried, failures turn after turn.
"""


class ResumeResult(StrEnum):
    """Result of a subscription that asked to resume."""

    RESUMED = "resumed"  # nothing was lost
    GAP = "gap"  # the requested publications are no longer held
    NEW_EPOCH = "new_epoch"  # the session has started again since


class MetricsSink:
    """Receives figures from the motion thread and from event loops; this class drops them.

    Methods of subclasses must be thread-safe, take only microseconds, and never raise. All times
    are in seconds.
    """

    def step(self, seconds: float, agents: int) -> None:
        """Records one engine call, and its number of agents."""

    def chunks(self, lateness: Seconds, sights: Int8) -> None:
        """Records chunks that left together: seconds of each after its scheduled time (negative:
        before it), and how well its agent is seen (`Sight`).
        """

    def queue(self, seconds: float) -> None:
        """Records the seconds of motion that wait for a subscriber after a publication."""

    def drops(self, policy: SlowReader, publications: int) -> None:
        """Records publications that were dropped for a slow subscriber."""

    def sent(self, tier: str, chunks: int, size: int) -> None:
        """Records a batch of chunks that was sent to a stream in a message of `size` bytes.

        `tier`: its ring from 0 on, "whole" for a stream without rings, or "hidden" for chunks
        beyond the last ring, which were not sent.
        """

    def resume(self, result: ResumeResult) -> None:
        """Records that a subscription asked to resume."""

    def goal_to_motion(self, seconds: float) -> None:
        """Records the seconds from a goal command to the time of the first chunk planned for it."""

    def refusal(self, command: str) -> None:
        """Records that a command, by its name in `MotionService`, ended with ResourceExhausted."""

    def fault(self, stage: str) -> None:
        """Records a contained error in a stage of a turn; see `world/agents/faults.py`."""

    def set_aside(self, what: str) -> None:
        """Records that a session or scene was removed since it could not continue; `what`: why."""

    def journal(self, entries: int, failed: bool) -> None:
        """Records that the journal wrote `entries` in one transaction, or failed to."""
