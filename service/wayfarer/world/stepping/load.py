"""The load of a world: work that is left out for lack of time, and refusals of new agents."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import partial
from typing import Final

from wayfarer.world.agents.registry import Registry
from wayfarer.world.agents.reservations import Reservation, Reservations
from wayfarer.world.stepping.admission import Admission, with_more
from wayfarer.world.stepping.budget import Budget, DegradationLevel
from wayfarer.world.stepping.costs import Counts, Weighted
from wayfarer.world.stepping.engine_call import PendingStep
from wayfarer.world.stepping.settings import WorldSettings

COASTING: Final = 0.25
"""Weight of agents that are seen at most as a root: when time is short they cost no engine call,
but they must be moved and sent, and some will come near.
"""


class Load:
    """Budget (degradation), `admission` and `reservations` of one world.

    `check_room`, `room_for` and `reserve` are thread-safe.
    """

    def __init__(
        self,
        *,
        settings: WorldSettings,
        registry: Registry,
        agents: Callable[[], Counts],
        distant: Callable[[], Counts] | None = None,
    ) -> None:
        """`agents()` counts the agents of each gender, `distant()` those of them that are seen at
        most as a root; None: there are none.
        """
        asked = max(search.candidates for search in settings.steering.searches.values())
        self._registry = registry
        self._agents = agents
        self._distant = distant
        self._limit = settings.limits.agents
        self._refuses = settings.admission.refuse
        self._full = DegradationLevel(asked)
        self._budget = Budget(asked, settings.budget) if settings.budget is not None else None
        self.admission = Admission(settings)
        self.reservations = Reservations()

    @property
    def level(self) -> DegradationLevel:
        """The present level of degradation; see budget.py."""
        return self._full if self._budget is None else self._budget.level

    @property
    def level_number(self) -> int:
        """The number of that level; 0: nothing is left out."""
        return 0 if self._budget is None else self._budget.number

    def allow(
        self, now: float, slack: float, held_share: float, under_way: int, distant: bool
    ) -> DegradationLevel:
        """The level for the next step; see `Budget.allow`."""
        if self._budget is None:
            return self._full
        return self._budget.allow(now, slack, held_share, under_way, distant)

    def spent(self, now: float, step: PendingStep, seconds: float) -> None:
        """Records that a step kept the engine busy for `seconds`."""
        self.admission.spent(now, step.call, len(step.batch.rows), seconds, self._weighted())
        if self._budget is not None:
            self._budget.spent(now, seconds)

    def capacity(self, now: float) -> int:
        """Number of agents, including present ones, that can be moved in time if the others are
        seen as well as these; 0: unknown.
        """
        fit, counted, weighted = self.admission.capacity(now), self._agents(), self._weighted()
        if not any(weighted):
            return fit
        return min(int(fit * sum(counted) / sum(weighted)), self._limit)

    def reserve(self, wanted: Reservation, now: float) -> AbstractContextManager[Reservation]:
        """Reserves room. Entering it raises NotFound, ResourceExhausted."""
        return self.reservations.held(wanted, partial(self.check_room, wanted, now))

    def room_for(self, session_id: str, genders: Sequence[str], now: float) -> None:
        """Raises NotFound, and ResourceExhausted if the agents could not be stepped in time."""
        self.check_room(Reservation.of(session_id, genders), now, self.reservations.all())

    def check_room(
        self, wanted: Reservation, now: float, held: Sequence[Reservation], admit: bool = True
    ) -> None:
        """Checks whether these agents fit in addition to the present ones and the reservations
        `held`.

        Without `admit`, only limits are checked, not time. Raises NotFound, ResourceExhausted.
        """
        self._registry.check_room(wanted, held)
        if admit and self._refuses:
            # the level is updated with each step: without agents it keeps its last value
            late = self.level.refuse and bool(self._registry.agents)
            coming = [gender for other in held for gender in other.genders]
            agents = with_more(self._weighted(), coming)
            self.admission.check(agents, wanted.genders, now, late)

    def _weighted(self) -> Weighted:
        """Agents of each gender; agents that may coast count with their weight."""
        agents = self._agents()
        if self._distant is None:
            return agents
        return [n - (1 - COASTING) * d for n, d in zip(agents, self._distant(), strict=True)]
