"""What one node may do: its lease and its slots. Implements `Ownership`; no network, no clock of
its own.

The event loop tells it what the directory answered; the motion thread asks before every turn. What
it reads there is one float, one set and one dictionary's item, each replaced or changed at once.
"""

import random
import time
from collections.abc import Callable, Collection
from typing import Final

from wayfarer.cluster.directory import share_of
from wayfarer.cluster.messages import Answer, LeaseRenewal, NodeInfo, NodeLoad, Registration
from wayfarer.cluster.slot_map import SlotMap, endpoint
from wayfarer.endpoint import Endpoint
from wayfarer.errors import Unavailable
from wayfarer.ids import slot_of

FRESH_S: Final = 120.0
"""A slot that was given out is in use for this long, until something is seen in it: a scene that
is being baked is not there yet."""


def boot_clock() -> float:
    """Seconds that go on while the process, or the whole machine, is stopped."""
    return time.clock_gettime(getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC))


class Tenancy:
    """Of one node."""

    def __init__(
        self, node: NodeInfo, go_on: bool = False, clock: Callable[[], float] = boot_clock
    ) -> None:
        """`go_on`: step without a lease, too (`LeaseRules.go_on`)."""
        self.node = node
        self.view = SlotMap()
        self.registered = False
        self._go_on = go_on
        self._clock = clock
        self._until = float("-inf")  # of the lease
        self._count = 0  # of messages
        self._held: dict[int, int] = {}  # slots in use, and their epochs
        self._pool: dict[int, int] = {}
        self._lost: frozenset[int] = frozenset()  # to be released before another step
        self._moving: set[int] = set()
        # some of what lives there is not here yet: the epoch of an adoption; 0: not owned yet
        self._coming: dict[int, int] = {}
        self._fresh: dict[int, float] = {}  # when they were given out
        self._used: set[int] = set()  # reported as used until it is known to have arrived
        self._freed: set[int] = set()
        self._adopted: set[int] = set()
        self._failed: set[int] = set()

    # ---- Ownership

    @property
    def own(self) -> Endpoint | None:
        """Where this node is called."""
        return endpoint(self.node)

    @property
    def nodes(self) -> list[Endpoint]:
        """See `Ownership`."""
        return self.view.places

    def endpoint_of(self, name: str) -> Endpoint | None:
        """Where what has this id lives; None: here, or nowhere that is known.

        Raises Unavailable for what is on its way here, and for what a node has that is down.
        """
        slot = slot_of(name)
        if slot in self._coming:
            raise Unavailable(f"{name!r} is on its way to this node; try again")
        if slot in self._held or slot in self._pool or slot in self._freed:
            return None
        found = self.view.owner(name)
        if found is not None and found.name == self.node.name:
            raise Unavailable(f"{name!r} is on its way to this node; try again")
        return None if found is None else endpoint(found)

    @property
    def has_slots(self) -> bool:
        """For new sessions; a node that has just come has none until the directory's answer."""
        return bool(self._pool or self._held)

    def new_key(self) -> int:
        """A slot of its own; when these are used up, one that another session shares.

        Raises Unavailable without a lease.
        """
        if not self.leased:
            raise Unavailable("this node has lost its cluster; it creates nothing until it is back")
        if self._pool:
            slot = min(self._pool)
            self._held[slot] = self._pool.pop(slot)
            self._used.add(slot)
        elif settled := [s for s in self._held if s not in self._moving]:
            slot = random.choice(settled)
        else:
            raise Unavailable("this node has no slot yet; it has just joined its cluster")
        self._fresh[slot] = self._clock()
        return slot

    def may_step(self) -> bool:
        """The lease holds, and nothing is here that has another owner."""
        return not self._lost and (self._go_on or self.leased)

    def epoch(self, session_id: str) -> int:
        """Of the slot; 0 for what is not here."""
        return self._held.get(slot_of(session_id), 0)

    def has(self, slot: int, epoch: int) -> bool:
        """Whether it is in use here, with this epoch."""
        return self._held.get(slot) == epoch

    # ---- what the directory is told

    @property
    def leased(self) -> bool:
        """Whether the lease holds now."""
        return self._clock() < self._until

    @property
    def held_until(self) -> float:
        """When the lease ends or has ended, by the clock."""
        return self._until

    @property
    def lost(self) -> frozenset[int]:
        """Slots whose sessions are to be released here."""
        return self._lost

    def registration(self, load: NodeLoad, present: Collection[int]) -> Registration:
        """To come, or to come again. `present`: as in `renewal`; a journal may have kept it."""
        for slot in set(present) - self._held.keys() - self._lost - self._coming.keys():
            self._held[slot] = 0
        self._count += 1
        return Registration(
            node=self.node,
            count=self._count,
            load=load,
            held=self._owned(),
            leased=self.leased,
        )

    def renewal(self, load: NodeLoad, present: Collection[int]) -> LeaseRenewal:
        """`present`: slots of the sessions and scenes that are here."""
        now = self._clock()
        self._fresh = {
            slot: at
            for slot, at in self._fresh.items()
            if now - at < FRESH_S and slot not in present
        }
        for slot in set(present) - self._held.keys() - self._lost - self._coming.keys():
            self._held[slot] = self._pool.pop(slot, 0)  # an imported snapshot
            self._used.add(slot)
        gone = set(self._held) - set(present) - set(self._fresh) - self._moving
        for slot in gone:
            del self._held[slot]
            self._used.discard(slot)
            self._freed.add(slot)
        self._count += 1
        named = self._used.intersection(self._held) | share_of(self._held, self._count)
        return LeaseRenewal(
            name=self.node.name,
            count=self._count,
            load=load,
            held={slot: self._held[slot] for slot in sorted(named - self._moving)},
            freed=tuple(sorted(self._freed)),
            adopted=tuple(sorted(self._adopted)),
            failed=tuple(sorted(self._failed)),
            seen=self.view.seen,
        )

    def take_registered(self, answer: Answer, told: Registration, sent_at: float) -> bool:
        """The answer to a registration. False: not heard, since it came late; do not obey it."""
        if told.count != self._count or not answer.lease_s:
            return False
        self.registered = True
        self._used = set(self._held) - set(told.held)
        self._freed.clear()
        self._take(answer, told.held, sent_at)
        return True

    def take_renewed(self, answer: Answer, told: LeaseRenewal, sent_at: float) -> bool:
        """The answer to a renewal. False: not heard, since it came late; do not obey it."""
        if told.count != self._count:
            return False
        if answer.fenced:
            self.registered, self._until, self._pool = False, float("-inf"), {}
            return False
        if not answer.lease_s:
            return False
        self._used -= told.held.keys()
        self._freed -= set(told.freed)
        self._adopted -= set(told.adopted)
        self._failed -= set(told.failed)
        self._take(answer, told.held, sent_at)
        return True

    def _take(self, answer: Answer, told: dict[int, int], sent_at: float) -> None:
        """`told`: what was said to be held. It says nothing of what has changed since."""
        owned = self._owned()
        same = {slot for slot, epoch in told.items() if owned.get(slot) == epoch}
        lost = same.intersection(answer.lost) - self._moving  # of these `transfer` tells
        self._lost |= lost
        for slot in lost:
            self._held.pop(slot, None)
        for slot, epoch in answer.epochs.items():
            if slot in same and slot in self._held:
                self._held[slot] = epoch
            elif slot not in owned and slot not in self._coming:
                self._freed.add(slot)
        self._pool = {
            slot: epoch
            for slot, epoch in answer.pool.items()
            if slot not in self._held and slot not in self._freed
        }
        self.view.take(answer.changes)
        self._until = sent_at + answer.lease_s

    def _owned(self) -> dict[int, int]:
        """Slots in use, with those that are being adopted, and their epochs."""
        return self._held | {slot: epoch for slot, epoch in self._coming.items() if epoch}

    # ---- what has happened here

    def released(self, slot: int) -> None:
        """Nothing of this slot is here any more."""
        self._lost -= {slot}

    def moving(self, slot: int) -> None:
        """All of it is frozen, to be given away; end that with `moved` or `stays`."""
        self._moving.add(slot)

    def moved(self, slot: int) -> None:
        """It has another owner."""
        self._moving.discard(slot)
        self._held.pop(slot, None)
        self._fresh.pop(slot, None)
        self._used.discard(slot)

    def stays(self, slot: int, epoch: int) -> None:
        """It was not given away, and has this epoch now."""
        self._moving.discard(slot)
        self._held[slot] = epoch

    def coming(self, slot: int, epoch: int = 0) -> None:
        """What lives in it is being put in here; end that with `came`, `adopted`, `failed` or
        `refused`. `epoch`: of an adoption's order, with which this node owns it.
        """
        self._coming[slot] = epoch
        self._freed.discard(slot)  # it was another session's

    def came(self, slot: int, epoch: int) -> None:
        """It was given to this node."""
        self._coming.pop(slot, None)
        self._held[slot] = epoch
        self._fresh[slot] = self._clock()
        self._pool.pop(slot, None)
        self._freed.discard(slot)

    def adopted(self, slot: int, epoch: int) -> None:
        """Its sessions live on here, from their replicas."""
        self.came(slot, epoch)
        self._adopted.add(slot)

    def refused(self, slot: int) -> None:
        """It could not be put in, or has another owner."""
        self._coming.pop(slot, None)

    def failed(self, slot: int) -> None:
        """No replica of it was here."""
        self._coming.pop(slot, None)
        self._failed.add(slot)
