"""Which node takes a new session or scene, and which one answers for a group without an owner."""

import hashlib
import random
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from typing import Final

from wayfarer.cluster.messages import SILENT_S, NodeInfo, NodeLoad
from wayfarer.errors import Unavailable

UNSEEN_S: Final = 2.0
"""Seconds after which a placed session is in its node's reports."""


@dataclass(slots=True)
class ClusterNode:
    """A node, as the directory knows it."""

    info: NodeInfo
    load: NodeLoad
    heard_at: float  # its last renewal
    has_ended: Callable[[bool], bool]  # its process, as far as that can be seen
    count: int = 0  # of the last message
    used: set[str] = field(default_factory=set)  # groups
    keepers: tuple[str, ...] = ()  # of its replicas: the present one, and the one before
    draining: bool = False
    placed: deque[tuple[float, int]] = field(default_factory=deque)
    """When a session was placed here, and how many the node had reported then."""

    def is_silent(self, now: float) -> bool:
        """Whether it may have stopped."""
        return now - self.heard_at > SILENT_S

    def sessions(self, now: float) -> int:
        """Its sessions, and those placed here that its clients have still to create."""
        while self.placed and self.placed[0][0] < now - UNSEEN_S:
            self.placed.popleft()
        # a report may hold some of those placed in this time: what each found, and those after it
        found = (reported - index for index, (_, reported) in enumerate(self.placed))
        return max(self.load.sessions, len(self.placed) + max(found, default=0))

    def is_like(self, other: "ClusterNode") -> bool:
        """Whether it can take what lives there: both have the same model and bodies."""
        return self.info.fingerprint == other.info.fingerprint


def place(members: Collection[ClusterNode], now: float, drawn: random.Random) -> ClusterNode:
    """The freer of two nodes drawn at random; it counts a new session there. Raises Unavailable."""
    able = able_of(members, now)
    if not able:
        why = Counter("draining" if one.draining else "starting or full" for one in members)
        told = ", ".join(f"{count} {what}" for what, count in why.items())
        raise Unavailable(f"no node takes new sessions: {told or 'none is registered'}")
    chosen = min(drawn.sample(able, min(2, len(able))), key=burden_of(able, now))
    chosen.placed.append((now, chosen.load.sessions))
    return chosen


def able_of(members: Collection[ClusterNode], now: float) -> list[ClusterNode]:
    """The nodes that take new sessions, all of one kind."""
    ready = [one for one in members if one.load.ready and not one.draining]
    found = [one for one in ready if not one.is_silent(now)] or ready
    # of several kinds the one with the most nodes: in a rolling change new nodes become
    # the majority once old ones drain
    kinds = Counter(one.info.fingerprint for one in found)
    kind = kinds.most_common(1)[0][0] if kinds else ""
    return [one for one in found if one.info.fingerprint == kind]


def burden_of(members: Collection[ClusterNode], now: float) -> Callable[[ClusterNode], float]:
    """A function for the share of a node's room that is taken.

    Agents come after their session: a session counts as the mean one of these nodes beside the
    agents that are there.
    """
    sessions = sum(one.load.sessions for one in members)
    mean = max(1.0, sum(one.load.agents for one in members) / max(1, sessions))
    return lambda one: (one.load.agents + mean * one.sessions(now)) / max(1, one.info.capacity)


def rendezvous(group: str, names: Iterable[str]) -> str:
    """The name that is first for a group; empty for none.

    When names come or go, only the groups of these change (highest random weight, Thaler and
    Ravishankar 1998).
    """
    return max(names, key=lambda name: hash_of(f"{group}/{name}"), default="")


def hash_of(text: str) -> int:
    """The same number for a text on every machine."""
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest())
