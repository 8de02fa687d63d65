"""Assigns each agent a phase within the 0.2 s step period, so that steps are spread evenly."""

from typing import Final

from wayfarer.spec import GENDERS, NEW_FRAMES

Load = list[list[int]]
"""Agents by phase and, within it, by gender (index into `spec.GENDERS`)."""
UNEVEN: Final = 2
"""A phase may hold this multiple of the emptiest phase's agents, plus `MARGIN`."""

MARGIN: Final = 2
"""Further agents that a phase may hold if that saves an engine call."""


class Phases:
    """The number of agents of each gender in each phase."""

    def __init__(self, count: int) -> None:
        """`count` divides `spec.NEW_FRAMES`."""
        self.frames = NEW_FRAMES // count
        self.load: Load = [[0] * len(GENDERS) for _ in range(count)]

    @property
    def agents(self) -> int:
        """Number of agents in all phases."""
        return sum(map(sum, self.load))

    @property
    def by_gender(self) -> list[int]:
        """Number of agents in all phases, by gender."""
        return [sum(phase[gender] for phase in self.load) for gender in range(len(GENDERS))]

    def enter(self, gender: int) -> int:
        """Assigns a phase to an agent. Among the phases not much fuller than the emptiest one, it
        prefers those that need no further engine call, since agents of one gender share theirs, and
        takes the emptiest of these.
        """
        sizes = [sum(phase) for phase in self.load]
        fullest = UNEVEN * min(sizes) + MARGIN

        def key(phase: int) -> tuple[bool, bool, int]:
            mixes = sizes[phase] > 0 and not self.load[phase][gender]
            return sizes[phase] > fullest, mixes, sizes[phase]

        phase = min(range(len(self.load)), key=key)
        self.load[phase][gender] += 1
        return phase

    def enter_at(self, start_frame: int, gender: int) -> None:
        """Adds an agent that began at this world frame."""
        self.load[start_frame % NEW_FRAMES // self.frames][gender] += 1

    def leave(self, start_frame: int, gender: int) -> None:
        """Removes an agent that began at this world frame."""
        self.load[start_frame % NEW_FRAMES // self.frames][gender] -= 1

    def next_frame(self, phase: int, earliest: int) -> int:
        """The first world frame of a phase that is not before `earliest`."""
        return earliest + (phase * self.frames - earliest) % NEW_FRAMES
