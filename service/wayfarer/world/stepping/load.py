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
    """Budget (degradation), admission and reservations of one world.

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
        self._admission = Admission(settings)
        self._reservations = Reservations()

    @property
    def level(self) -> DegradationLevel:
        """The present level of degradation; see budget.py."""
        return self._full if self._budget is None else self._budget.level

    @property
    def level_number(self) -> int:
        """The number of that level; 0: nothing is left out."""
        return 0 if self._budget is None else self._budget.number

    @property
    def refused_agents(self) -> int:
        """Number of agents refused so far because they could not be stepped in time."""
        return self._admission.refused

    def allow(
        self, now: float, slack: float, held_share: float, under_way: int, distant: bool
    ) -> DegradationLevel:
        """The level for the next step; see `Budget.allow`."""
        if self._budget is None:
            return self._full
        return self._budget.allow(now, slack, held_share, under_way, distant)

    def measured(self, agents: int, candidates: int, seconds: float) -> None:
        """Records that an engine call of this size took `seconds` during warm-up."""
        self._admission.measured(agents, candidates, seconds)

    def spent(self, now: float, step: PendingStep, seconds: float) -> None:
        """Records that a step kept the engine busy for `seconds`."""
        self._admission.spent(now, step.call, len(step.batch.rows), seconds, self._weighted())
        if self._budget is not None:
            self._budget.spent(now, seconds)

    def worked(self, now: float, seconds: float, chunks: int) -> None:
        """Records the thread's own `seconds` since the last step, and its published `chunks`."""
        self._admission.worked(now, seconds, chunks)

    def share(self, now: float) -> float:
        """Share of the last seconds for which the engine, or the thread if busier, was busy."""
        return self._admission.load(now)

    def capacity(self, now: float) -> int:
        """Number of agents, including present ones, that can be moved in time if the others are
        seen as well as these; 0: unknown.
        """
        fit, counted, weighted = self._admission.capacity(now), self._agents(), self._weighted()
        if not any(weighted):
            return fit
        return min(int(fit * sum(counted) / sum(weighted)), self._limit)

    def held(self) -> tuple[Reservation, ...]:
        """The reservations that are held now."""
        return self._reservations.all()

    def reserve(self, wanted: Reservation, now: float) -> AbstractContextManager[Reservation]:
        """Reserves room. Entering it raises NotFound, ResourceExhausted."""
        return self._reservations.held(wanted, partial(self.check_room, wanted, now))

    def release(self, reservation: Reservation) -> None:
        """Releases room that is used, or no longer needed. Safe to call twice."""
        self._reservations.release(reservation)

    def room_for(self, session_id: str, genders: Sequence[str], now: float) -> None:
        """Raises NotFound, and ResourceExhausted if the agents could not be stepped in time."""
        self.check_room(Reservation.of(session_id, genders), now, self._reservations.all())

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
            self._admission.check(agents, wanted.genders, now, late)

    def _weighted(self) -> Weighted:
        """Agents of each gender; agents that may coast count with their weight."""
        agents = self._agents()
        if self._distant is None:
            return agents
        return [n - (1 - COASTING) * d for n, d in zip(agents, self._distant(), strict=True)]
