"""How often one may call: token buckets of callers, and of addresses that show no credentials.

Own code rather than the library `limits`: its memory storage goes by the time of day, so a clock
that is set back locks everybody out, keeps every name it has seen until a thread sweeps it, and
cannot tell how long to wait.
"""

import time
from collections import OrderedDict
from collections.abc import Callable
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Final

from wayfarer.errors import ResourceExhausted
from wayfarer.transport.caller import Caller

REMEMBERED: Final = 4096
"""Maximum number of names that have a bucket at a time."""

FAILURES: Final = 1.0
"""Failed attempts of one address per second, in the long run; a burst of `FAILURE_BURST` first."""

FAILURE_BURST: Final = 20


@dataclass(slots=True)
class _Bucket:
    left: float
    at: float  # clock's seconds of `left`


class Buckets:
    """A bucket of tokens for each name, filled at a steady rate.

    Holds `REMEMBERED` names at most. One that is forgotten starts with a full bucket, so what is
    forgotten first is the one left alone longest.
    """

    def __init__(self) -> None:
        self._buckets: OrderedDict[str, _Bucket] = OrderedDict()

    def take(self, name: str, rate: float, burst: float, now: float) -> float:
        """Take a token: 0, or the seconds until there is one. `rate` per second."""
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
    """The server's bounds on calls. `clock` gives seconds that never go back."""

    def __init__(self, calls_per_second: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate = calls_per_second
        self._clock = clock
        self._callers = Buckets()
        self._failures = Buckets()

    def count(self, caller: Caller) -> None:
        """One more call. Raises ResourceExhausted that says when to come again."""
        rate = caller.quota.calls_per_second or self._rate
        if wait := self._callers.take(caller.name, rate, 2 * rate, self._clock()):
            raise ResourceExhausted(
                f"{caller.name!r} may make {rate} calls per second, in bursts {2 * rate}", wait
            )

    def failed(self, address: str) -> None:
        """Somebody there has shown no credentials that hold.

        Raises ResourceExhausted when that happens too often. Callers who do show them are let in
        from the same address: it may be that of a proxy.
        """
        if wait := self._failures.take(address, FAILURES, FAILURE_BURST, self._clock()):
            raise ResourceExhausted("too many attempts with wrong credentials from here", wait)


def _uncounted() -> None:
    """Outside of any call there is nothing to bound."""


_count: ContextVar[Callable[[], None]] = ContextVar("count", default=_uncounted)


def count_call() -> None:
    """Count a command that came in over a stream as one more call of the present caller.

    Raises ResourceExhausted.
    """
    _count.get()()


def count_with(count: Callable[[], None]) -> None:
    """Let `count_call` in the rest of this task be `count`."""
    _count.set(count)
