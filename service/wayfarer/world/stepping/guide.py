"""The influence of a scene and its people on a step: all that an agent's own goal does not say."""

from typing import NamedTuple, Protocol

from wayfarer.engines.engine import Float
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Motion, Seeds
from wayfarer.world.rows import Index


class NextTarget(NamedTuple):
    """The next targets of some rows."""

    ahead: GoalColumns
    """The goals that steering sees: in a scene, the next stretch of the way. A row that is not
    `given` waits: it stops, and walks on when it is given again."""

    judged: GoalColumns
    """The goals by which arrival is judged: a goal that is near in a straight line but far to walk
    has a radius below 0."""


class Guide(Protocol):
    """Called by the scheduler before every step, for the rows about to be stepped together."""

    def course(self, rows: Index, start: Motion, goals: GoalColumns) -> NextTarget:
        """The next targets of these rows. Changes `goals`, by which arrival is judged, and the
        memory of others in `start`.
        """
        ...

    def obstacles(self, rows: Index, seed: Seeds) -> Float:
        """Obstacles to keep clear of [A, OBSTACLES, 7]: see `StepInputs.obstacles`."""
        ...
