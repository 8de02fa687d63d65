"""One engine call: the agents that are stepped by it, and what is known of it while it is made."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.engines.padding import pick
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Gait, Seeds
from wayfarer.world.rows import Flags, Index


@dataclass(frozen=True, slots=True)
class Batch:
    """Agents of one model and gender that are stepped together."""

    rows: Index
    model: int  # number
    gender: str
    seed: Seeds
    gait: Gait  # of the step to come
    goals: GoalColumns  # as their being reached is judged
    inputs: StepInputs
    candidates: int
    reduced: Flags  # rows for which steering asks for more candidates
    mirrored: Flags  # rows whose mirror image the engine moves; see mirror.py

    def take(self, which: Index) -> "Batch":
        """Some of its rows."""
        return replace(
            self,
            rows=self.rows[which],
            seed=self.seed.take(which),
            gait=self.gait.take(which),
            goals=self.goals.take(which),
            inputs=pick(self.inputs, which),
            reduced=self.reduced[which],
            mirrored=self.mirrored[which],
        )


@dataclass(frozen=True, slots=True)
class Call:
    """One engine call, as far as its duration depends on it."""

    rows: int  # with the padding
    candidates: int


@dataclass(frozen=True, slots=True)
class PendingStep:
    """An engine call that is under way."""

    number: int
    batch: Batch
    call: Call
    outputs: Callable[[], StepOutputs]  # waits for them; of all rows, the padding included


Outputs = Callable[[], StepOutputs]
Ready = tuple[Batch, StepInputs, Outputs]
"""A batch, what the engine gets for it, and the call."""

Launch = Callable[[Outputs], Outputs]
"""Sets a call going, and gives another one that waits for its result."""


def at_once(call: Outputs) -> Outputs:
    """The call is made when its result is asked for."""
    return call
