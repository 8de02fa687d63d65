"""The replicas that a node keeps for the nodes whose neighbour it is."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from wayfarer.cluster.group_map import GroupMap
from wayfarer.errors import ResourceExhausted
from wayfarer.ids import group_of

REPLICA_BYTES: Final = 512 * 1024 * 1024
"""Maximum size of all replicas that a node keeps for others."""

KEPT_S: Final = 330.0
"""Seconds after which a replica without renewal is dropped: five of the longest leases. A replica
may be three leases old when a directory asks, and is adopted two leases later (directory.py)."""

QUIET_S: Final = 3.0
"""Replicas do not get older in a longer pause: nobody has a lease then."""

KEEP_S: Final = 120.0
"""Seconds that a node may take to store the replicas that it is sent."""

CONTENT: Final = "/content"
"""Suffix of a scene's id: its constant content, baked. The replica under the id is its state."""


@dataclass(slots=True)
class KeptReplica:
    """The latest replica of a session or scene."""

    owner: str  # node
    state: bytes
    at: float  # see `_now`


class Replicas:
    """The latest state of other nodes' sessions and scenes."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._kept: dict[str, KeptReplica] = {}  # by id of a session or scene
        self._called_at, self._time = clock(), 0.0

    def keep(self, owner: str, name: str, state: bytes) -> None:
        """Keeps a replica in place of an earlier one. Raises ResourceExhausted."""
        others = sum(len(one.state) for kept, one in self._kept.items() if kept != name)
        if others + len(state) > REPLICA_BYTES:
            raise ResourceExhausted(f"a node keeps {REPLICA_BYTES >> 20} MiB of replicas at most")
        self._kept[name] = KeptReplica(owner, state, self._now())

    def renew(self, owner: str, present: set[str]) -> set[str]:
        """Drops replicas that the owner does not have any more; returns those of `present` whose
        content is not here.
        """
        now = self._now()
        for name, replica in list(self._kept.items()):
            if replica.owner == owner and name.removesuffix(CONTENT) in present:
                replica.at = now
            elif replica.owner == owner:
                del self._kept[name]
        return {name for name in present if name + CONTENT not in self._kept}

    def age(self, view: GroupMap) -> None:
        """The directory has answered, so replicas without renewal get older. One is dropped when
        it is too old or its owner has lost it. The answer may be older than a new replica.
        """
        now = self._now()
        for name, one in list(self._kept.items()):
            age, is_lost = now - one.at, view.is_not_of(one.owner, group_of(name))
            if age > KEPT_S or (is_lost and age > QUIET_S):
                del self._kept[name]

    def of(self, group: str) -> dict[str, KeptReplica]:
        """The replicas of a group, by name; they are kept until `drop`."""
        return {name: kept for name, kept in self._kept.items() if group_of(name) == group}

    def ages(self) -> dict[str, tuple[str, float]]:
        """The owner of the youngest replica of each group, and its age."""
        states = [item for item in self._kept.items() if not item[0].endswith(CONTENT)]
        states.sort(key=lambda item: item[1].at)
        return {group_of(name): (one.owner, self._time - one.at) for name, one in states}

    def drop(self, group: str) -> None:
        """Drops the replicas of a group whose sessions live here now, or have ended."""
        for name in self.of(group):
            del self._kept[name]

    def _now(self) -> float:
        now = self._clock()
        self._time += min(now - self._called_at, QUIET_S)
        self._called_at = now
        return self._time

    def __len__(self) -> int:
        return len(self._kept)
