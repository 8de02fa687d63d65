"""Room held for admitted agents that are still being created.

So concurrent requests are not admitted into the same room, and the others are refused at once.
Thread-safe.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Lock
from typing import Self

from wayfarer.spec import GENDERS


@dataclass(frozen=True, slots=True, eq=False)
class Reservation:
    """Room for agents of these genders (indices into `spec.GENDERS`) in a session."""

    session_id: str
    genders: tuple[int, ...]

    @classmethod
    def of(cls, session_id: str, genders: Iterable[str]) -> Self:
        """The same, for genders by name."""
        return cls(session_id, tuple(GENDERS.index(gender) for gender in genders))


class Reservations:
    """All reservations of a world."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._held: list[Reservation] = []

    @contextmanager
    def held(
        self, wanted: Reservation, check: Callable[[Sequence[Reservation]], None]
    ) -> Iterator[Reservation]:
        """Holds room until the agents exist (`release`) or the caller has given up.

        `check(held)` raises if they do not fit into the remaining room.
        """
        with self._lock:
            check(self._held)
            self._held.append(wanted)
        try:
            yield wanted
        finally:
            self.release(wanted)

    def release(self, held: Reservation) -> None:
        """Releases the room, as its agents are in slots, or never will be. Safe to call twice."""
        with self._lock:
            if held in self._held:
                self._held.remove(held)

    def all(self) -> tuple[Reservation, ...]:
        """The present reservations."""
        with self._lock:
            return tuple(self._held)
