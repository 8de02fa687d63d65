"""The slots of each of a server's workers: those that are its number, modulo their count."""

import secrets
from collections.abc import Sequence
from dataclasses import dataclass

from wayfarer.endpoint import Endpoint
from wayfarer.ids import SLOTS, slot_of


@dataclass(frozen=True, slots=True)
class WorkerShares:
    """The share of worker `index`. Implements `Ownership`; the shares never change."""

    index: int
    endpoints: Sequence[Endpoint]  # of all workers, in order

    @property
    def own(self) -> Endpoint | None:
        """Where this worker is called."""
        return self.endpoints[self.index]

    def endpoint_of(self, name: str) -> Endpoint | None:
        """The worker that the id itself names; None: this one."""
        home = worker_of(name, len(self.endpoints))
        return None if home == self.index else self.endpoints[home]

    def new_key(self) -> int:
        """A slot of this worker."""
        count = len(self.endpoints)
        return secrets.randbelow(SLOTS // count) * count + self.index

    def may_step(self) -> bool:
        """Always."""
        return True

    def epoch(self, session_id: str) -> int:
        """0: there is no other owner."""
        return 0


def worker_of(name: str, count: int) -> int:
    """The worker, of `count`, in which what has this id lives; 0 for what is no id."""
    return slot_of(name) % count
