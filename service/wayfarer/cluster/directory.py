"""Who owns which group: leases, epochs, placement, adoption, drains. No network, no Ray.

What nodes and entries call: `renew`, `claim`, `decline`, `ended`, `place`, `drain` and `look`. The
rules, on which "never two owners" rests:

- A node's lease runs here from when its request *arrived* and there from when it was *sent*, and
  here `DRIFT` longer: the node always knows of its end first, and stops (node_lease.py).
- A group changes its owner only by its owner's wish (`claim`), or after its owner has ended or
  its lease has. Each change gives it an epoch greater than any before. Until it is adopted, it is
  given back to its owner that returns, or to the node that had taken it from that.
- A move is decided here and nowhere else. The owner freezes what lives in the group and sends it to
  the new node, which asks for the group once it has everything, and resumes it after the answer.
  An owner that does not hear from the new node asks to keep the group. The first of these two
  questions to arrive decides. Each node asks until it is answered, and keeps the group frozen
  meanwhile; the same question always has the same answer. An owner that asks hears of
  its loss only after the new node has named the group. Its state and its copy stay until then.
- A directory that starts knows nothing. For the length of a lease it gives nothing away; the nodes
  tell it what they hold, and of what they keep replicas. Between two that claim one group the
  greater epoch is right. Replicas are adopted if their owner does not come for another lease.
- In each renewal a share of the groups is compared, so that a node and the directory that disagree
  notice it within seconds.

A group without an entry: a live node chosen by hash (`placement.rendezvous`) answers that there is
nothing. The clock gives seconds, and never goes back.
"""

import random
import time
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from wayfarer.cluster.messages import (
    ADOPTED,
    Answer,
    Changes,
    LeaseRenewal,
    NodeInfo,
    NodeLoad,
    NodeOrder,
    NodeState,
    Status,
)
from wayfarer.cluster.placement import ClusterNode, able_of, burden_of, hash_of, place
from wayfarer.errors import Aborted, FailedPrecondition, NotFound, Unavailable

V = TypeVar("V")

DRIFT: Final = 1.1
"""A lease is this much longer here than at the node: clocks differ in rate by far less."""

REMEMBERED: Final = 4096
"""Placements known by their request, so that a create sent twice meets its first reply; and nodes
that have ended, so that none is entered by a message that it sent before."""

LOGGED: Final = 8192
"""Changes of the view that are kept; a reader that has seen less gets the whole view."""

AWAY_S: Final = 600.0
"""How long a node whose lease has ended may come back. Until then nobody hears that what it may
have does not exist."""

AT_ONCE: Final = 4
"""Groups that a draining node moves at a time."""

SHARES: Final = 16
"""In each renewal a node names one of this many of its groups, by their last digit. The next
renewal names others."""


@dataclass(frozen=True, slots=True)
class LeaseRules:
    """The rules of a cluster's leases."""

    lease_s: float = 2.0
    nodes: int = 0
    """How many there will be, if that is known, and if no directory was before this one: it gives
    nothing away until all nodes have named the groups that they have kept, and take sessions."""
    keep: bool = False
    """Nodes keep on disk what they own. Nobody adopts it: it waits for its node's next life."""


@dataclass(slots=True)
class _Entry:
    owner: str
    epoch: int
    before: tuple[str, int] | None = None  # its owner before, with that epoch, if it came from one
    keepers: tuple[str, ...] | None = None  # being adopted: who else may have a replica, in order
    named: bool = False  # by its owner, with this epoch: an answer to `claim` has arrived there


class Directory:
    """One for a cluster. Not thread-safe."""

    def __init__(
        self,
        rules: LeaseRules,
        generation: int,
        clock: Callable[[], float] = time.monotonic,
        seed: int | None = None,
        watch: Callable[[NodeInfo], Callable[[bool], bool]] = lambda node: lambda forsaken: False,
    ) -> None:
        """`generation`: greater than that of any directory before; microseconds since 1970 are.

        Epochs begin there, so that they still grow after a restart of the directory. `watch`
        returns a function that says whether the process of a node is known to have ended. With
        True, it may end it: the node is silent, and one that is not has its copies.
        """
        self.rules = rules
        self._clock = clock
        self._watch = watch
        self.counters: Counter[str] = Counter()
        self._generation = self._epoch = generation
        self._lease_s = rules.lease_s * DRIFT
        self._settled_at = clock() + self._lease_s
        self._was_settled = False  # when it was looked at last
        self._nodes: dict[str, ClusterNode] = {}
        self._groups: dict[str, _Entry] = {}
        self._version = 0
        self._nodes_version = 0
        self._log: deque[tuple[int, str]] = deque(maxlen=LOGGED)  # version, group
        self._placed: OrderedDict[str, str] = OrderedDict()  # group → node
        self._over: OrderedDict[str, None] = OrderedDict()  # names of nodes that have ended
        self._came: set[int] = set()  # numbers of the nodes that have ever taken sessions
        self._away: dict[str, float] = {}  # nodes that may come back, and until when
        self._missing: dict[str, set[str]] = {}  # groups without an owner; who of them may have it
        self._kept: dict[str, dict[str, tuple[float, str]]] = {}
        """Replicas when this directory started, by group and keeper: their age, and the owner."""
        self._waiting: dict[int, set[str]] = {}  # groups by the number of the node that keeps them
        self._random = random.Random(seed)

    # ---- nodes

    def renew(self, told: LeaseRenewal) -> Answer:
        """Prolong a node's lease, take its reports, give it its orders.

        A node that is not known here is asked for all that it holds. It may say that at any time.
        """
        self.expire()
        node, whole = self._nodes.get(told.name), told.node
        if whole is not None:
            if told.name in self._over:  # sent before it ended
                return Answer()
            self._hear_of_replicas(told)
            if not (self._settled() or told.leased or self.rules.nodes) and told.held:
                return Answer()  # who of two claimants is right is known once all have come
            node = node or self._enter(whole)
        if node is None:
            return Answer(fenced=True)
        if told.count <= node.count:
            return Answer()
        node.count, node.load = told.count, told.load
        if told.load.ready:
            self._came.add(node.info.number)
        lost = list[str]()
        for group, epoch in told.held.items():
            self._epoch = max(self._epoch, epoch)
            entry = self._groups.get(group)
            had = self._had(entry, told.name, epoch) or self._had(entry, told.name, 0)
            if entry is None or had or (entry.owner != told.name and entry.epoch < epoch):
                # made there, or come with a snapshot; or given up as lost, and who adopted it
                # meanwhile may have ended, too; or of an earlier directory, whose lease still holds
                known = epoch if told.leased or not (entry is None or had) else 0
                self._own(group, told.name, known)
            if not self._has(told.name, group, epoch):
                lost.append(group)
            elif epoch == self._groups[group].epoch:
                self._groups[group].named = True
        if whole is not None:
            self._has_told(told.name)
        # an adoption that the node had been asked for continues
        freed = told.freed if whole is None else node.used.difference(told.held)
        for group in node.used.intersection(freed):
            if not self._is_adopted(group):
                self._disown(group)
                self._kept.pop(group, None)
        compared = node.used.intersection({*told.held, *share_of(node.used, told.count)})
        epochs = {g: self._groups[g].epoch for g in compared if not self._is_adopted(g)}
        return self._answer(node, told.seen, tuple(lost), epochs)

    def _enter(self, info: NodeInfo) -> ClusterNode:
        node = self._nodes[info.name] = ClusterNode(
            info, NodeLoad(), self._clock(), self._watch(info)
        )
        self._nodes_changed()
        for group in self._waiting.pop(info.number, ()):
            self._own(group, info.name)
        return node

    def ended(self, name: str) -> None:
        """The process of a node is known to have ended: `name` is its own, or that of its place,
        where the next one starts. The keepers of its replicas adopt its groups, or they wait for
        its next life (`LeaseRules.keep`).
        """
        _remember(self._over, name, None)
        for one in [*self._nodes, *self._away]:
            if name in (one, one.rpartition("-")[0]):
                self._away[one] = self._all_told_at
                if one in self._nodes:
                    self._end(self._nodes.pop(one))

    def _end(self, node: ClusterNode) -> None:
        self._nodes_changed()
        if self.rules.keep:
            self._waiting.setdefault(node.info.number, set()).update(node.used)
            return
        for group in sorted(node.used):
            entry = self._groups[group]
            if entry.keepers is None:
                # the node that gave it away may not know that, and still hold it frozen
                giver = entry.before[:1] if entry.before else ()
                entry.keepers = (*node.keepers, *self._orphan(group), *giver, node.info.name)
                entry.before = node.info.name, entry.epoch
            self._pass_on(group)

    def expire(self) -> None:
        """Fences the nodes whose lease has ended, or whose process has."""
        now = self._clock()
        if self._settled() and not self._was_settled:
            self._was_settled = True
            self._touch("")  # readers shall know it
        heard = {name for name, node in self._nodes.items() if not node.is_silent(now)}
        for name, node in list(self._nodes.items()):
            if node.has_ended(name not in heard and not heard.isdisjoint(node.keepers)):
                self.ended(name)
        over = now - self._lease_s
        silent = [node for node in self._nodes.values() if node.heard_at <= over]
        for node in silent:  # first: none of them adopts what another had
            self.counters["expired"] += 1
            self._away[node.info.name] = now + AWAY_S
            del self._nodes[node.info.name]
        for node in silent:
            self._end(node)
        for name in [name for name, until in self._away.items() if until < now]:
            self._has_told(name)

    def _has_told(self, name: str) -> None:
        """A node that was away has come, and has named its groups, or it never will."""
        if self._away.pop(name, None) is None:
            return
        for group, may_have in list(self._missing.items()):
            may_have.discard(name)
            if may_have:
                continue
            if keepers := self._orphan(group):
                before = self._kept[group][keepers[0]][1], 0
                self._own(group, keepers[0], before=before, keepers=keepers[1:])
            else:
                self.counters["lost"] += 1
                self._disown(group)

    def _hear_of_replicas(self, told: LeaseRenewal) -> None:
        """Their owners may have ended with an earlier directory, before anybody adopted them."""
        late = self._clock() > self._all_told_at
        for group, (owner, age) in told.kept.items():
            if late or age > 3 * self._lease_s:  # its owner had ended it, or another one had it
                continue
            self._kept.setdefault(group, {})[told.name] = age, owner
            if owner not in self._nodes and group not in self._groups:
                self._away.setdefault(owner, self._all_told_at)
                self._missing.setdefault(group, set()).add(owner)
                self._touch(group)

    def _orphan(self, group: str) -> tuple[str, ...]:
        """Nodes with replicas of what an earlier directory had, the youngest first."""
        kept = self._kept.get(group, {})
        found = [one for one in kept if one in self._nodes and kept[one][1] not in self._nodes]
        return tuple(sorted(found, key=kept.__getitem__))

    def drain(self, name: str) -> None:
        """Asks a node to give its sessions away and to end. Raises NotFound, FailedPrecondition."""
        node = self._nodes.get(name)
        if node is None:
            known = ", ".join(sorted(self._nodes)) or "none"
            raise NotFound(f"there is no node {name!r}; there are {known}", "node", name)
        if node.used and not self._equals(node):
            raise FailedPrecondition(
                f"node {name} holds {len(node.used)} groups of sessions, and no other node has "
                "the same model and bodies, to take them; start one first"
            )
        node.draining = True

    def claim(self, group: str, owner: str, epoch: int, to: str) -> int:
        """Gives a group to `to`, if `owner` still has it with this epoch; returns its new epoch.

        `to` asks, and has all that lives there, frozen. `owner` asks for itself to keep the group,
        or because it has adopted it: no other node gets it with this epoch then. Safe to call
        twice.

        Raises Aborted when the group has another owner or epoch, FailedPrecondition; Unavailable
        while that is not known: ask again.
        """
        self.expire()
        entry, target, source = self._groups.get(group), self._nodes.get(to), self._nodes.get(owner)
        if target is None or not self._settled():
            raise Unavailable("not all nodes have come back to the directory; ask again")
        has = entry is not None and entry.owner == to and entry.epoch != epoch
        if entry is not None and has and (owner == to or entry.before == (owner, epoch)):
            self._touch(group)
            entry.keepers = None  # said twice; or it was to adopt the group, and needs no replica
            return entry.epoch
        is_its = entry is not None and (entry.owner, entry.epoch) == (owner, epoch)
        is_its = is_its or self._had(entry, owner, epoch)
        if entry is None:  # an earlier directory's answer was lost; its giver has named the replica
            is_its = to in {one for _, one in self._kept.get(group, {}).values()}
        if entry is not None and owner == to and not is_its:
            if self._is_adopted(group):  # it is its own if there is no replica
                raise Unavailable(f"group {group} is being adopted by {entry.owner}; ask again")
            if entry.before == (owner, epoch) and not entry.named:  # this directory may end before
                raise Unavailable(f"group {group} is on its way to {entry.owner}; ask again")
        if not is_its:
            raise self._not_its(group, owner, epoch)
        if source is not None and not target.is_like(source):
            raise FailedPrecondition(f"node {to} has another model or other bodies than {owner}")
        if self._is_adopted(group):
            self.counters["adopted"] += 1
        elif to != owner:
            self.counters["moved"] += 1
        self._own(group, to, before=(owner, epoch))
        return self._groups[group].epoch

    def decline(self, group: str, owner: str, epoch: int, to: str) -> None:
        """Ends an adoption that `owner` cannot carry out: it has no replica, or no room. The node
        `to` has the replicas now; empty: no node is known to have them.

        Raises Aborted when the group has another owner or epoch.
        """
        entry = self._groups.get(group)
        if entry is None or (entry.owner, entry.epoch) != (owner, epoch):
            raise self._not_its(group, owner, epoch)
        self._pass_on(group, to)

    def _not_its(self, group: str, owner: str, epoch: int) -> Aborted:
        entry = self._groups.get(group)
        found = f"{entry.owner}'s with epoch {entry.epoch}" if entry else "nobody's"
        return Aborted(f"group {group} is not {owner}'s with epoch {epoch}: it is {found}")

    # ---- new sessions

    def place(self, group: str = "") -> NodeInfo:
        """The node for a new session or scene: the freer of two drawn at random.

        `group`: that of a request with an id. If the request was sent before, this is the node that
        has, or will have, what it made. Raises Unavailable.
        """
        self.expire()
        now = self._clock()
        if group and not self._settled():
            raise Unavailable("not all nodes have come back to the directory; ask again")
        entry, placed = self._groups.get(group), self._nodes.get(self._placed.get(group, ""))
        if entry is not None:
            if entry.owner not in self._nodes or self._is_adopted(group):
                raise Unavailable(f"the node of group {group} has ended; ask again")
            return self._nodes[entry.owner].info
        if group in self._missing:
            raise Unavailable(f"the node of group {group} is silent; ask again")
        if placed is not None and not placed.draining:
            return placed.info
        chosen = place(self._nodes.values(), now, self._random)
        self.counters["placed"] += 1
        if group:
            _remember(self._placed, group, chosen.info.name)
        return chosen.info

    # ---- answers

    def _answer(
        self,
        node: ClusterNode,
        seen: tuple[int, int],
        lost: tuple[str, ...],
        epochs: dict[str, int],
    ) -> Answer:
        now = self._clock()
        node.heard_at = now
        self._choose_keeper(node)
        return Answer(
            lease_s=self.rules.lease_s,
            epochs=epochs,
            lost=lost,
            neighbour=node.keepers[0] if node.keepers else "",
            draining=node.draining,
            done=node.draining and not node.used and self._all_told_at < now,
            orders=tuple(self._orders(node, now)),
            changes=self._changes(seen),
        )

    def _orders(self, node: ClusterNode, now: float) -> Iterable[NodeOrder]:
        adoptions = [group for group in node.used if self._is_adopted(group)]
        for group in sorted(adoptions):
            yield NodeOrder(kind="adopt", group=group, epoch=self._groups[group].epoch)
        if not (node.draining and self._settled()):
            return
        able = [
            one
            for one in able_of(self._nodes.values(), now)
            if one is not node and one.is_like(node)
        ]
        if not able:
            return
        able.sort(key=burden_of(able, now))
        for i, group in enumerate(sorted(node.used - set(adoptions))[:AT_ONCE]):
            to = able[i % len(able)].info.name
            yield NodeOrder(kind="move", group=group, epoch=self._groups[group].epoch, to=to)

    def look(self, seen: tuple[int, int]) -> tuple[Status, Changes | None]:
        """The state of the cluster, and changes of owners since (generation, version)."""
        self.expire()
        return self._status(), self._changes(seen)

    def _changes(self, seen: tuple[int, int]) -> Changes | None:
        generation, version = seen
        if seen == (self._generation, self._version):
            return None
        # the log has every change since its oldest
        whole = generation != self._generation or version + 1 < self._log[0][0]
        known = {*self._groups, *self._missing}
        touched = known if whole else {g for at, g in self._log if at > version and g}
        return Changes(
            generation=self._generation,
            version=self._version,
            whole=whole,
            settled=self._was_settled,
            groups={g: self._told_owner(g) for g in touched},
            nodes=tuple(node.info for node in self._nodes.values())
            if whole or self._nodes_version > version
            else None,
        )

    def _told_owner(self, group: str) -> str:
        entry = self._groups.get(group)
        if entry is None:
            return ADOPTED if group in self._missing else ""
        return entry.owner if entry.keepers is None else ADOPTED

    def _status(self) -> Status:
        now = self._clock()
        nodes = tuple(
            NodeState(
                node=node.info,
                load=node.load,
                groups=len(node.used),
                lease_left_s=max(0.0, node.heard_at + self._lease_s - now),
                silent_s=now - node.heard_at,
                draining=node.draining,
                neighbour=node.keepers[0] if node.keepers else "",
            )
            for node in sorted(self._nodes.values(), key=lambda one: one.info.name)
        )
        return Status(
            generation=self._generation,
            settled=self._settled(),
            nodes=nodes,
            counters=dict(self.counters),
        )

    # ---- groups

    def _settled(self) -> bool:
        if self.rules.nodes:
            return len(self._came) >= self.rules.nodes
        return self._clock() >= self._settled_at

    @property
    def _all_told_at(self) -> float:
        """The time from which the lease of a node that has not come counts as ended."""
        return self._settled_at + self._lease_s

    def _pass_on(self, group: str, first: str = "") -> None:
        """Gives a group to `first`, or the next node that may have a replica. If no such node is
        here, the first node now away that names it gets it; if none is away, it is lost.
        """
        entry = self._groups[group]
        left = [name for name in (first, *(entry.keepers or ())) if name in self._nodes]
        if not left:
            self._disown(group)
            if self._away:
                self._missing[group] = set(self._away)
            else:
                self.counters["lost"] += 1
            return
        self._own(group, left[0], before=entry.before, keepers=tuple(left[1:]))

    def _own(self, group: str, owner: str, epoch: int = 0, **more: Any) -> None:
        """`epoch`: 0: the next one. `more`: see `_Entry`."""
        self._disown(group)
        self._epoch += 1
        self._groups[group] = _Entry(owner, epoch or self._epoch, **more)
        self._nodes[owner].used.add(group)

    def _disown(self, group: str) -> None:
        entry = self._groups.pop(group, None)
        self._missing.pop(group, None)
        if entry is not None and entry.owner in self._nodes:
            self._nodes[entry.owner].used.discard(group)
        self._touch(group)

    def _has(self, name: str, group: str, epoch: int) -> bool:
        """Whether what a node has with this epoch is its own, and not left from an earlier time."""
        entry = self._groups[group]
        return entry.owner == name and (entry.keepers is None or entry.epoch == epoch)

    def _had(self, entry: _Entry | None, name: str, epoch: int) -> bool:
        """Whether a node owned, with this epoch, a group that is now being adopted."""
        return entry is not None and entry.keepers is not None and entry.before == (name, epoch)

    def _is_adopted(self, group: str) -> bool:
        """Whether a group's owner has still to find replicas of what lived there."""
        return group in self._groups and self._groups[group].keepers is not None

    def _equals(self, node: ClusterNode) -> set[str]:
        """Names of the nodes that could take its groups."""
        stay = (other for other in self._nodes.values() if not other.draining and other is not node)
        return {other.info.name for other in stay if other.is_like(node)}

    def _choose_keeper(self, node: ClusterNode) -> None:
        """Keeps the neighbour while it is good; the one before still has older replicas."""
        if self.rules.keep:
            return
        name, able = node.info.name, self._equals(node)
        node.keepers = tuple(keeper for keeper in node.keepers if keeper in self._nodes)
        if node.keepers and node.keepers[0] in able:
            return
        if able:
            after = [other for other in able if hash_of(other) > hash_of(name)]
            node.keepers = (min(after or able, key=hash_of), *node.keepers[:1])

    def _nodes_changed(self) -> None:
        self._touch("")
        self._nodes_version = self._version

    def _touch(self, group: str) -> None:
        self._version += 1
        self._log.append((self._version, group))


def share_of(groups: Iterable[str], count: int) -> set[str]:
    """The groups that the renewal of this number compares."""
    due = f"{count % SHARES:x}"
    return {group for group in groups if group[-1] == due}


def _remember(known: OrderedDict[str, V], name: str, value: V) -> None:
    known[name] = value
    if len(known) > REMEMBERED:
        known.popitem(last=False)
