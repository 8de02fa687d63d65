"""What one node may do: its lease and its groups. Implements `Ownership`; no network, no clock of
its own.

The event loop tells it what the directory answered; the motion thread asks before every turn. What
it reads there is one float, one set and one dictionary's item, each replaced or changed at once.
"""

import asyncio
import contextlib
import os
import time
from collections.abc import Callable, Collection, Coroutine, Iterable
from pathlib import Path
from typing import Any, Final

from wayfarer.cluster.directory import share_of
from wayfarer.cluster.group_map import GroupMap, endpoint
from wayfarer.cluster.messages import Answer, LeaseRenewal, NodeInfo, NodeLoad, NodeOrder
from wayfarer.endpoint import Endpoint
from wayfarer.errors import Unavailable
from wayfarer.ids import group_of, new_group

CLAIM_S: Final = 1.0
"""Seconds to wait for the directory's answer to a new group. A later answer does no harm: each
renewal names the group again."""


def boot_clock() -> float:
    """Seconds of a clock that runs while the process, or the whole machine, is stopped."""
    return time.clock_gettime(getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC))


def machine() -> str:
    """Names this machine and its process ids; empty where processes cannot be watched."""
    if not hasattr(os, "pidfd_open"):
        return ""
    boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    return f"{boot} {Path('/proc/self/ns/pid').readlink()}"


class NodeLease:
    """The groups that a node owns, and its lease."""

    def __init__(self, node: NodeInfo, clock: Callable[[], float] = boot_clock) -> None:
        self.node = node
        self.view = GroupMap()
        self.registered = False
        self.unclaimed = asyncio.Event()
        """Set when something was made here that the directory has to hear of now."""
        self.copied: Callable[[str], Coroutine[Any, Any, None]] = _alone
        """See `Ownership`; `Replication` does it."""
        self._answered = asyncio.Event()  # the next time
        self._clock = clock
        self._until = float("-inf")  # of the lease
        self._draining = False
        self._count = 0  # of messages
        self._held: dict[str, int] = {}  # groups in use, and their epochs; 0: not known yet
        self._lost: frozenset[str] = frozenset()  # to be released before another step
        self._frozen: set[str] = set()  # until the directory has decided who gets them
        self._coming: dict[str, Iterable[str]] = {}
        """Ids of what comes, for groups that have not come yet."""
        self._freed: set[str] = set()  # the directory does not know that yet
        self._given: set[str] = set()  # nor that its answer has come: the giver waits for that

    # ---- Ownership

    @property
    def own(self) -> Endpoint | None:
        """The address at which this node is called."""
        return endpoint(self.node)

    @property
    def nodes(self) -> list[Endpoint]:
        """See `Ownership`."""
        return self.view.places

    def endpoint_of(self, name: str) -> Endpoint | None:
        """The address of the node that has this id; None: this node has it, or none is known to.

        Raises Unavailable while it is on its way here, or its node is down.
        """
        group = group_of(name)
        if group in self._coming:
            raise Unavailable(f"{name!r} is on its way to this node; try again")
        if group in self._held or group in self._freed:
            return None
        found = self.view.owner(name)
        if found is not None and found.name == self.node.name:
            raise Unavailable(f"{name!r} is on its way to this node; try again")
        return None if found is None else endpoint(found)

    def new_group(self) -> str:
        """A group that no other node has. The directory hears of it once something lives in it.

        Raises Unavailable without a lease, and when the node is drained.
        """
        if not self.leased:
            raise Unavailable("this node has lost its cluster; it creates nothing until it is back")
        if self._draining:
            raise Unavailable("this node is about to end; try again")
        return new_group()

    async def claimed(self, name: str) -> None:
        """See `Ownership`; `CLAIM_S` at most until it is found."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(CLAIM_S):
                while not self.epoch(name):
                    self.unclaimed.set()
                    await self._answered.wait()
        await self.copied(name)

    def may_step(self) -> bool:
        """Whether the lease holds and no group of this node has another owner."""
        return self.leased and not self._lost

    def epoch(self, session_id: str) -> int:
        """The epoch of the group of a session; 0 if this node does not own it."""
        return self._held.get(group_of(session_id), 0)

    def owes(self, order: NodeOrder) -> bool:
        """Whether an order has still to be done."""
        epoch = self._held.get(order.group, 0)
        if order.kind == "move":
            return epoch == order.epoch
        return epoch < order.epoch or order.group in self._frozen  # it has begun, and failed

    # ---- reports to the directory

    @property
    def leased(self) -> bool:
        """Whether the lease holds now."""
        return self._clock() < self._until

    @property
    def held_until(self) -> float:
        """When the lease ends or has ended, by the clock."""
        return self._until

    @property
    def lost(self) -> frozenset[str]:
        """Groups whose sessions this node must release."""
        return self._lost

    def renewal(self, load: NodeLoad, present: Collection[str]) -> LeaseRenewal:
        """`present`: groups of this node's sessions and scenes; a journal may have kept them."""
        for group in set(present) - self._held.keys() - self._lost - self._coming.keys():
            self._held[group] = 0
            self._freed.discard(group)
        for group in set(self._held) - set(present) - self._frozen - self._coming.keys():
            del self._held[group]
            self._freed.add(group)
        self._count += 1
        named = share_of(self._held, self._count)
        self._given &= self._held.keys()
        named.update(self._given)
        named.update(group for group, epoch in self._held.items() if not epoch)
        held = {group: self._held[group] for group in sorted(named - self._frozen)}
        comes = not self.registered
        return LeaseRenewal(
            name=self.node.name,
            count=self._count,
            load=load,
            node=self.node if comes else None,
            leased=comes and self.leased,
            held=dict(self._held) if comes else held,
            freed=tuple(sorted(self._freed)),
            seen=self.view.seen,
        )

    def take(self, answer: Answer, told: LeaseRenewal, sent_at: float) -> bool:
        """The answer to a renewal. False: not heard, since it came late; do not obey it."""
        if told.count != self._count:
            return False
        if answer.fenced:
            self.registered, self._until = False, float("-inf")
        if answer.fenced or not answer.lease_s:
            return False
        self.registered = True
        self._freed -= set(told.freed)
        self._given -= told.held.keys()
        # the answer does not cover changes after the renewal was sent
        same = {group for group, epoch in told.held.items() if self._held.get(group) == epoch}
        lost = same.intersection(answer.lost)
        self._lost |= lost - self._frozen  # nobody steps the others: `claim` decides
        for group in lost - (self._frozen - self._coming.keys()):
            del self._held[group]
        for group, epoch in answer.epochs.items():
            if group in same and group in self._held and group not in self._frozen:
                self._held[group] = epoch
            elif group not in self._held and group not in self._coming:
                self._freed.add(group)
        self.view.take(answer.changes)
        self._until = sent_at + answer.lease_s
        self._draining = answer.draining
        self._answered.set()
        self._answered = asyncio.Event()
        return True

    # ---- what has happened here

    @property
    def names_coming(self) -> list[str]:
        """Ids of sessions and scenes that may be this node's, though no caller finds them yet."""
        return [name for names in self._coming.values() for name in names]

    def released(self, group: str) -> None:
        """Notes that nothing of this group is here any more."""
        self._lost -= {group}

    def going(self, group: str) -> None:
        """Notes that the group is frozen here and about to be given away, until `decided`."""
        self._frozen.add(group)

    def coming(self, group: str, epoch: int = 0, names: Iterable[str] = ()) -> None:
        """Notes that the group's sessions are being put into this node, frozen, until `decided`.

        `epoch`: that of the order to adopt the group; `names`: the ids of all that comes.
        """
        self._frozen.add(group)
        self._coming[group] = names
        self._freed.discard(group)  # it lived here once
        if epoch:
            self._held[group] = epoch

    def decided(self, group: str, epoch: int) -> None:
        """Notes that this node has the group, with this epoch; epoch 0: another node has it.

        A group that comes stays `coming` until `came`.
        """
        self._frozen.discard(group)
        if epoch:
            self._held[group] = epoch
            self._given.add(group)
        else:
            self._held.pop(group, None)
            self._coming.pop(group, None)

    def came(self, group: str) -> None:
        """Notes that callers now find all of the group here."""
        self._coming.pop(group, None)


async def _alone(name: str) -> None:
    """Until the node has joined, there is no neighbour."""
