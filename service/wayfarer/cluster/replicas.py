"""The replicas that a node keeps for the nodes whose neighbour it is."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from wayfarer.errors import ResourceExhausted
from wayfarer.ids import group_of

REPLICA_BYTES: Final = 512 * 1024 * 1024
"""All replicas that a node keeps for others."""

LOG_BYTES: Final = 128 * 1024 * 1024
"""Bytes of their logs. A log without room is not kept, and begins anew when its node dies."""

PART_BYTES: Final = 64
"""Bytes that a part of a log takes in addition to its content."""

KEPT_S: Final = 60.0
"""Seconds after which a replica without renewal is dropped."""

CONTENT: Final = "/content"
"""Suffix of a scene's id: its constant content. The replica under the id is its state."""


@dataclass(slots=True)
class KeptReplica:
    """The latest of a session or scene."""

    owner: str  # node
    state: bytes
    at: float  # monotonic
    log_parts: list[bytes] = field(default_factory=list)  # of a recorded session
    log_bytes: int = 0


class Replicas:
    """The latest state of other nodes' sessions and scenes."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._kept: dict[str, KeptReplica] = {}  # by id of a session or scene

    def keep(self, owner: str, name: str, state: bytes, part: bytes = b"", after: int = 0) -> int:
        """In place of an earlier one. `part` of its log follows `after` others, if it is not empty.

        Returns how many parts there are now: none where others are missing, or where there is no
        room for a log. Raises ResourceExhausted.
        """
        before = self._kept.get(name)
        if self.bytes + len(state) - (len(before.state) if before else 0) > REPLICA_BYTES:
            raise ResourceExhausted(f"a node keeps {REPLICA_BYTES >> 20} MiB of replicas at most")
        now = KeptReplica(owner, state, self._clock())
        if before is not None and after and len(before.log_parts) == after:
            now.log_parts, now.log_bytes = before.log_parts, before.log_bytes
        self._kept[name] = now
        if part and len(now.log_parts) == after:
            now.log_parts.append(part)
            now.log_bytes += len(part) + PART_BYTES
        if sum(replica.log_bytes for replica in self._kept.values()) > LOG_BYTES:
            now.log_parts, now.log_bytes = [], 0
        return len(now.log_parts)

    def renew(self, owner: str, present: set[str]) -> None:
        """These are on the owner now, and no others."""
        now = self._clock()
        for name, replica in list(self._kept.items()):
            if replica.owner == owner and name.removesuffix(CONTENT) in present:
                replica.at = now
            elif replica.owner == owner or now - replica.at > KEPT_S:
                del self._kept[name]

    def of(self, group: str) -> dict[str, KeptReplica]:
        """Those of a group, by name; they are kept until `drop`."""
        return {name: kept for name, kept in self._kept.items() if group_of(name) == group}

    def drop(self, group: str) -> None:
        """What lived in this group lives here, or nowhere any more."""
        for name in self.of(group):
            del self._kept[name]

    @property
    def bytes(self) -> int:
        """The size of all states."""
        return sum(len(replica.state) for replica in self._kept.values())

    def __len__(self) -> int:
        return len(self._kept)
