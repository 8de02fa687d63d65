"""Limits on the rate of calls: token buckets of callers, and of addresses without credentials.

The library `limits` does not fit: its memory storage uses the time of day, so a clock that is set
back locks everybody out; it keeps every name until a thread sweeps it; and it cannot tell how long
to wait.
"""

import time
from collections import OrderedDict
from collections.abc import Callable
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Final

from wayfarer.errors import ResourceExhausted
from wayfarer.transport.edge.caller import Caller

REMEMBERED: Final = 4096
"""Maximum number of names that have a bucket at the same time."""

FAILURES: Final = 1.0
"""Failed attempts per second that one address may make, after `FAILURE_BURST` at once."""

FAILURE_BURST: Final = 20


@dataclass(slots=True)
class _Bucket:
    left: float
    at: float  # clock's seconds of `left`


class Buckets:
    """A token bucket for each name, filled at a steady rate.

    It holds up to `REMEMBERED` names and forgets the one that was unused longest. A forgotten name
    starts again with a full bucket.
    """

    def __init__(self) -> None:
        self._buckets: OrderedDict[str, _Bucket] = OrderedDict()

    def take(self, name: str, rate: float, burst: float, now: float) -> float:
        """Takes a token. Returns 0, or the seconds until there is one. `rate`: per second."""
        bucket = self._filled(name, rate, burst, now)
        if bucket.left >= 1:
            bucket.left -= 1
            return 0.0
        return (1 - bucket.left) / rate

    def __len__(self) -> int:
        return len(self._buckets)

    def _filled(self, name: str, rate: float, burst: float, now: float) -> _Bucket:
        bucket = self._buckets.setdefault(name, _Bucket(burst, now))
        self._buckets.move_to_end(name)
        if len(self._buckets) > REMEMBERED:
            self._buckets.popitem(last=False)
        bucket.left = min(burst, bucket.left + max(0.0, now - bucket.at) * rate)
        bucket.at = now
        return bucket


class CallRates:
    """The server's limits on calls. `clock` returns seconds that never go back."""

    def __init__(self, calls_per_second: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate = calls_per_second
        self._clock = clock
        self._callers = Buckets()
        self._failures = Buckets()

    def count(self, caller: Caller) -> None:
        """Counts a call. Raises ResourceExhausted with the time to wait."""
        rate = caller.quota.calls_per_second or self._rate
        if wait := self._callers.take(caller.name, rate, 2 * rate, self._clock()):
            raise ResourceExhausted(
                f"{caller.name!r} may make {rate} calls per second, in bursts {2 * rate}", wait
            )

    def failed(self, address: str) -> None:
        """Counts a call from an address without valid credentials.

        Raises ResourceExhausted if there are too many. Callers with valid credentials are still
        admitted from the same address, since it may be a proxy's.
        """
        if wait := self._failures.take(address, FAILURES, FAILURE_BURST, self._clock()):
            raise ResourceExhausted("too many attempts with wrong credentials from here", wait)


def _uncounted() -> None:
    """Counts nothing: outside of a call there is nothing to limit."""


_count: ContextVar[Callable[[], None]] = ContextVar("count", default=_uncounted)


def count_call() -> None:
    """Counts a command that came over a stream as a call of the present caller.

    Raises ResourceExhausted.
    """
    _count.get()()


def count_with(count: Callable[[], None]) -> None:
    """Makes `count_call` use `count` in the rest of this task."""
    _count.set(count)
