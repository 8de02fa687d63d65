"""Engine calls beside the motion thread, which does all else meanwhile.

Two calls are under way at a time, in order: when one is done the next one is there already, so the
engine's threads never wait for Python.
"""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

from wayfarer.runtime.engines.engine import StepOutputs
from wayfarer.runtime.stepping.scheduler import Flight, Launch, Outputs

FLIGHTS: Final = 2


@dataclass(slots=True)
class Trip:
    """A call that has been begun; its times are those of the clock."""

    flight: Flight
    begun: float
    ended: float | None = None


class Crew:
    """Belongs to the motion thread, but for its own threads."""

    def __init__(self, clock: Callable[[], float], wake: Callable[[], None]) -> None:
        """`wake` is called, from another thread, whenever a call is done."""
        self._clock = clock
        self._wake = wake
        self._pool = ThreadPoolExecutor(FLIGHTS, "engine-call")
        self._trips: deque[Trip] = deque()
        self._last_ended = float("-inf")
        self._since: float | None = None  # when the first call under way was begun

    def age(self, now: float) -> float:
        """Seconds since the first call under way was begun; 0 when there is none. Thread-safe."""
        since = self._since
        return 0.0 if since is None else now - since

    @property
    def is_idle(self) -> bool:
        """No call is under way."""
        return not self._trips

    @property
    def has_room(self) -> bool:
        """One more call can be begun."""
        return len(self._trips) < FLIGHTS

    @property
    def has_landed(self) -> bool:
        """The first call is done."""
        return bool(self._trips) and self._trips[0].ended is not None

    def send_off(self, begin: Callable[[Launch], Flight | None]) -> bool:
        """Begin a call; False when `begin` finds nothing to do."""
        calls: list[Future[StepOutputs]] = []

        def launch(call: Outputs) -> Outputs:
            calls.append(self._pool.submit(call))
            return calls[0].result

        begun = self._clock()
        flight = begin(launch)
        if flight is None:
            return False
        trip = Trip(flight, begun)
        self._trips.append(trip)
        self._since = self._trips[0].begun
        calls[0].add_done_callback(lambda _: self._land(trip))
        return True

    def landed(self) -> Iterator[tuple[Flight, float]]:
        """Take out calls that are done, in order; for each how long the engine was at it alone."""
        while self.has_landed:
            trip = self._trips.popleft()
            self._since = self._trips[0].begun if self._trips else None
            assert trip.ended is not None
            seconds = max(trip.ended - max(trip.begun, self._last_ended), 0.0)
            self._last_ended = trip.ended
            yield trip.flight, seconds

    def close(self) -> None:
        """Begin nothing more; what is under way is lost."""
        self._pool.shutdown(wait=False)

    def _land(self, trip: Trip) -> None:
        trip.ended = self._clock()
        self._wake()
