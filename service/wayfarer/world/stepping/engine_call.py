"""One engine call: the agents that it steps, and its data while it is made."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.engines.padding import pick
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Motion
from wayfarer.world.rows import Flags, Index


@dataclass(frozen=True, slots=True)
class Batch:
    """Agents of one model and gender that are stepped together."""

    rows: Index
    model: int  # number
    gender: str
    start: Motion  # from which they are stepped, with the gait of the next step
    goals: GoalColumns  # by which arrival is judged
    inputs: StepInputs
    candidates: int
    reduced: Flags  # rows for which steering requests more candidates
    mirrored: Flags  # rows whose mirror image the engine moves; see mirror.py

    def take(self, which: Index) -> "Batch":
        """Some of its rows."""
        return replace(
            self,
            rows=self.rows[which],
            start=self.start.take(which),
            goals=self.goals.take(which),
            inputs=pick(self.inputs, which),
            reduced=self.reduced[which],
            mirrored=self.mirrored[which],
        )


@dataclass(frozen=True, slots=True)
class Call:
    """The properties of an engine call on which its duration depends."""

    rows: int  # including padding
    candidates: int


@dataclass(frozen=True, slots=True)
class PendingStep:
    """An engine call in progress."""

    number: int
    batch: Batch
    call: Call
    outputs: Callable[[], StepOutputs]  # waits for them; all rows, including padding


Outputs = Callable[[], StepOutputs]
Ready = tuple[Batch, StepInputs, Outputs]
"""A batch, its engine inputs, and the call."""

Launch = Callable[[Outputs], Outputs]
"""Starts a call, and returns another one that waits for its result."""


def at_once(call: Outputs) -> Outputs:
    """Makes the call when its result is requested."""
    return call
