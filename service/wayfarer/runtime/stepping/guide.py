"""How a scene and the people in it enter a step: everything that an agent's own goal does not say."""

from typing import Protocol

from wayfarer.runtime.engines.engine import Float
from wayfarer.runtime.world.rows import Index
from wayfarer.runtime.world.slots import Gait, Goals, Seeds


class Guide(Protocol):
    """Asked by the scheduler before every step, for the rows about to be stepped together."""

    def course(self, rows: Index, seed: Seeds, gait: Gait, goals: Goals) -> Goals:
        """The goals as steering shall see them: for whoever is in a scene, the next stretch.

        Whether a goal has been reached is judged by the goals themselves. A row that is not
        `given` waits: it stops, and walks on when it is given again. The arguments are not
        changed.
        """
        ...

    def obstacles(self, rows: Index, seed: Seeds) -> Float:
        """What bodies should keep clear of [A, OBSTACLES, 7]: see `StepInputs.obstacles`."""
        ...
