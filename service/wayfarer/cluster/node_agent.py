"""A node's part in its cluster: it renews the lease and obeys orders. Runs on the node's event
loop.
"""

import asyncio
import contextlib
import os
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from typing import Any, Final, TypeVar

import structlog

from wayfarer.cluster.group_map import endpoint
from wayfarer.cluster.messages import (
    CALL_S,
    Answer,
    DirectoryLink,
    NodeInfo,
    NodeLink,
    NodeLoad,
    NodeOrder,
    NodePlan,
)
from wayfarer.cluster.node_lease import NodeLease, boot_clock, machine
from wayfarer.cluster.replicas import CONTENT, KEEP_S, KeptReplica, Replicas
from wayfarer.cluster.replication import Replication
from wayfarer.errors import (
    Aborted,
    FailedPrecondition,
    NotFound,
    ResourceExhausted,
    Unavailable,
    WayfarerError,
)
from wayfarer.transport.edge.caller import Caller, enter
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.gateway.moves import Arrival, is_scene

log = structlog.get_logger(__name__)

T = TypeVar("T")

RENEW_S: Final = 0.25
"""Seconds between renewals: several in the length of any lease."""

ADOPT_S: Final = 600.0
"""Seconds that an adoption waits for room, if no other node has any."""

HAND_ON_S: Final = 3.0
"""Seconds between two offers to another node of what waits here for room."""

STATS_S: Final = 0.25
"""Seconds to wait for a busy motion thread. If they were more, one lost answer of the directory
would end the lease."""

SESSION_S: Final = 0.1
"""Seconds more that a call may take for each session that it gives away."""


class NodeAgent:
    """The agent of a node: renews its lease and carries out the directory's orders."""

    def __init__(
        self,
        lease: NodeLease,
        gateway: Gateway,
        directory: DirectoryLink,
        nodes: NodeLink,
        replicas: Replicas,
        replication: Replication,
        stop: Callable[[], None],
    ) -> None:
        """`stop` ends the server: everything has been given away."""
        self._lease = lease
        self._moves = gateway.moves
        self._gateway = gateway
        self._directory = directory
        self._nodes = nodes
        self._replicas = replicas
        self._replication = replication
        self._stop = stop
        self._counted = NodeLoad()
        self._leased = False
        self._held_until = 0.0
        # groups that are being moved, taken or adopted
        self._busy: dict[str, asyncio.Task[Any]] = {}

    async def renewing(self) -> None:
        """Renews the lease and carries out the directory's orders, without end."""
        while True:
            try:
                await self._renew()
            except Unavailable as error:
                log.warning("no answer from the directory", reason=str(error))
            except Exception:  # else the lease would never be renewed again
                log.exception("a renewal failed")
            self._tell_lease()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._lease.unclaimed.wait(), RENEW_S)
            self._lease.unclaimed.clear()

    # What other nodes and entries call

    async def keep(self, owner: str, copies: dict[str, bytes]) -> dict[str, str]:
        """Keeps these replicas, by id. Returns the refused ones with the reasons."""
        refused = dict[str, str]()
        for name, state in copies.items():
            try:
                self._replicas.keep(owner, name, state)
            except WayfarerError as error:
                refused[name] = str(error)
        return refused

    async def present(self, owner: str, names: list[str]) -> set[str]:
        """Drops replicas of sessions and scenes that the owner does not have any more. Returns the
        scenes whose content is not here.
        """
        return set(filter(is_scene, self._replicas.renew(owner, set(names))))

    async def ask(self, rpc: str, caller: Caller, told: dict[str, Any]) -> Any:
        """Answers a call that concerns all nodes; the gateway checks whether the caller may."""
        enter(caller)
        return await self._gateway.calls[rpc](**told)

    async def take(self, owner: str, group: str, epoch: int, live: dict[str, bytes]) -> None:
        """Takes a group from another node, with all that lives there, if the directory agrees.

        Raises WayfarerError.
        """
        if group in self._lease.lost or self._is_busy(group):
            raise Unavailable(f"group {group} is busy on this node; try again")
        coming = self._come(group, owner, epoch, live)
        taking = self._busy[group] = asyncio.create_task(coming, name="take")
        # if the caller waits no more, the directory is asked all the same: it may have decided
        if (refusal := await asyncio.shield(taking)) is not None:
            raise refusal

    async def _come(
        self, group: str, owner: str, epoch: int, states: dict[str, bytes], orphan: bool = False
    ) -> WayfarerError | None:
        """All that lives in a group comes to this node, is frozen, and resumes if the directory
        gives the group to this node. `orphan`: these are copies, and nobody else has it. Returns
        the reason if it does not come: the caller may have gone.
        """
        self._lease.coming(group, epoch if orphan else 0, states)
        found, kept = dict[str, Arrival | None](), self._replicas.of(group).items()
        contents = {name.removesuffix(CONTENT): one.state for name, one in kept if CONTENT in name}
        try:
            await _together(
                lambda name: self._arrival(name, states[name], contents.get(name, b""), orphan),
                states,
                found,
            )
        except BaseException as error:
            await self._leave(group, found)
            if isinstance(error, WayfarerError):
                return error
            raise
        came = {name: one for name, one in found.items() if one is not None}
        own = self._lease.node.name
        given = await self._decision("claim", group, owner, epoch, own) if came else 0
        if not given:
            await self._leave(group, came)
            gone = NotFound(f"nothing of group {group} has come", "group", group)
            return Aborted(f"{owner} does not give group {group} away any more") if came else gone
        self._lease.decided(group, given)
        self._replicas.drop(group)
        try:
            for arrival in came.values():
                with contextlib.suppress(NotFound):
                    await self._moves.enter(arrival)
        finally:
            self._lease.came(group)
        log.info("sessions came", sessions=list(came), of=owner, epoch=given, at=boot_clock())
        return None

    async def _arrival(
        self, name: str, state: bytes, content: bytes, orphan: bool
    ) -> Arrival | None:
        """A session or scene, taken. An orphan waits for room; without it the whole group does not
        come. None: an orphan that is refused for good, and that the others do not wait for.
        """
        now = asyncio.get_running_loop().time
        ends = now() + HAND_ON_S
        while True:
            try:
                return await self._moves.take(name, state, content, orphan)
            except Exception as error:
                full = isinstance(error, Unavailable | ResourceExhausted)
                if not orphan or (full and now() > ends):
                    raise
                if not full:
                    fault = None if isinstance(error, WayfarerError) else error
                    log.error("not adopted", name=name, reason=str(error), exc_info=fault)
                    return None
                await asyncio.sleep(RENEW_S)

    async def _leave(self, group: str, came: Iterable[str]) -> None:
        for name in reversed(list(came)):  # another node continues with all of them
            await self._moves.release(name, None)
        self._lease.decided(group, 0)

    async def _decision(self, verb: str, group: str, owner: str, epoch: int, to: str) -> int:
        """Returns the directory's answer to `claim` or `decline`; 0 if another node has the group.

        Asks until the directory answers: the group is frozen on this node, so it can wait.
        """
        while True:
            try:
                if self._lease.registered:  # else the directory does not count with this node
                    return int(await self._directory.call(verb, group, owner, epoch, to) or 0)
            except (Aborted, FailedPrecondition) as error:
                log.warning("a group has another owner", group=group, reason=str(error))
                return 0
            except WayfarerError as error:
                log.warning("a decision is awaited", group=group, reason=str(error))
            await asyncio.sleep(RENEW_S)

    # The lease

    async def _renew(self) -> None:
        if not (self._lease.registered or self._gateway.started):  # it still restores
            return
        load = await self._load()
        sent_at, told = boot_clock(), self._lease.renewal(load, self._moves.groups)
        if told.node is not None:
            told = told.model_copy(update={"kept": self._replicas.ages()})
        answer = await self._directory.call("renew", told)
        if answer.fenced:
            log.error("the directory has given this node up; it comes back without what it lost")
        if self._lease.take(answer, told, sent_at):
            self._replicas.age(self._lease.view)
            await self._obey(answer)

    async def _load(self) -> NodeLoad:
        """The present load. A busy node without time to count people gives the last count."""
        with contextlib.suppress(WayfarerError, TimeoutError):
            async with asyncio.timeout(STATS_S):
                stats = await self._gateway.loop_stats()
            self._counted = NodeLoad(agents=stats.agents, fits=stats.capacity)
        ready = self._gateway.started and self._gateway.alive and self._lease.registered
        return self._counted.model_copy(update={"ready": ready, "sessions": self._moves.live})

    def _tell_lease(self) -> None:
        leased = self._lease.leased
        if leased:
            self._held_until = self._lease.held_until
        if leased != self._leased:
            self._leased = leased
            log.info("lease held" if leased else "lease ended", until=self._held_until)

    # Orders

    async def _obey(self, answer: Answer) -> None:
        for group in sorted(self._lease.lost):
            if not (self._is_busy(group) and self._busy[group].get_name() != "move"):
                await self._give_up(group)  # otherwise more may come into it; nobody is stepped
        self._replication.neighbour = answer.neighbour
        self._busy = {group: task for group, task in self._busy.items() if not task.done()}
        for order in answer.orders:
            if order.group not in self._busy and self._lease.owes(order):
                work = self._adopt(order) if order.kind == "adopt" else self._move(order)
                self._busy[order.group] = asyncio.create_task(work, name=order.kind)
        empty = not (self._gateway.streams or self._busy or self._moves.groups)
        if answer.done and empty:  # all clients know the new node
            log.info("drained: nothing lives here any more")
            self._stop()

    def _is_busy(self, group: str) -> bool:
        return group in self._busy and not self._busy[group].done()

    async def _give_up(self, group: str) -> None:
        """Ends a group that has another owner, before any agent is stepped again."""
        for name in self._moves.of(group):
            owner = None
            with contextlib.suppress(Unavailable):
                owner = self._lease.view.owner(name)
            await self._moves.release(name, endpoint(owner) if owner else None)
            log.warning("session lost to another node", session_id=name, at=boot_clock())
        self._lease.released(group)

    async def _adopt(self, order: NodeOrder) -> None:
        """Resumes what lives in a group, from the copies on this node. Without room it waits, or
        another node resumes it.
        """
        group, own, to = order.group, self._lease.node.name, ""
        kept, now = self._replicas.of(group), asyncio.get_running_loop().time
        states = {name: one.state for name, one in kept.items() if not name.endswith(CONTENT)}
        ends = now() + ADOPT_S
        while refusal := await self._come(group, own, order.epoch, states, orphan=True):
            if isinstance(refusal, Aborted):  # another node is to adopt it
                return
            for name, one in kept.items():  # which may wait for longer than replicas live
                await self.keep(one.owner, {name: one.state})
            full = isinstance(refusal, Unavailable | ResourceExhausted) and now() < ends
            to = await self._hand_on(kept) if full else ""
            if to or not full:
                log.warning("group not adopted", group=group, to=to, reason=str(refusal))
                await self._decision("decline", group, own, order.epoch, to)
                self._replicas.drop(group)
                return

    async def _hand_on(self, kept: dict[str, KeptReplica]) -> str:
        """Leaves replicas with the node that has the most room; returns its name, "" for none."""
        own = self._lease.node
        try:
            node = await self._directory.call("place")
            if node.name == own.name or node.fingerprint != own.fingerprint:
                return ""
            for name, one in kept.items():
                told = one.owner, {name: one.state}
                if await self._nodes.call(node, "keep", *told, seconds=KEEP_S):
                    return ""  # there is no room for it
        except WayfarerError:
            return ""
        return str(node.name)

    async def _move(self, order: NodeOrder) -> None:
        """Gives all that is in a group to another node, or keeps it all: the directory decides."""
        lease, group, node = self._lease, order.group, self._lease.view.nodes.get(order.to)
        own, names = lease.node.name, self._moves.of(group)
        if node is None or not all(map(self._moves.is_movable, names)):
            return
        content = dict[str, bytes]()
        try:
            for name in filter(is_scene, names):  # takes long; the sessions run meanwhile
                content[name + CONTENT] = await self._moves.content(name)
                if refused := await self._nodes.call(node, "keep", own, content, seconds=KEEP_S):
                    raise ResourceExhausted(refused[name + CONTENT])
        except WayfarerError as error:
            log.error("scene not moved", group=group, to=order.to, reason=str(error))
            return
        began, frozen = boot_clock(), dict[str, bytes]()
        try:
            await _together(self._moves.freeze, names, frozen)
            if set(self._moves.of(group)) != set(names) or group in lease.lost:
                raise Unavailable("somebody has come or gone meanwhile")
        except WayfarerError as error:
            log.error("session not moved", group=group, to=order.to, reason=str(error))
            await self._thaw(frozen)
            return
        lease.going(group)
        try:
            told, seconds = (own, group, order.epoch, frozen), CALL_S + SESSION_S * len(frozen)
            await self._nodes.call(node, "take", *told, seconds=seconds)
        except WayfarerError as error:  # it may have come there all the same
            log.error("session not moved", group=group, to=order.to, reason=str(error))
            if epoch := await self._decision("claim", group, own, order.epoch, own):
                lease.decided(group, epoch)
                await self._thaw(frozen)
                return
        # should the other node end before its own neighbour has a copy
        if refused := await self.keep(node.name, frozen | content):
            log.warning("no replica of what was moved", group=group, refused=sorted(refused))
        for name in names:
            await self._moves.release(name, endpoint(node))
            ms = round(1e3 * (boot_clock() - began))
            log.info("session moved", session_id=name, to=node.name, ms=ms)
        lease.decided(group, 0)
        await self._replication.copied(group)  # the neighbour drops what it has of it

    async def _thaw(self, names: Iterable[str]) -> None:
        for name in names:
            with contextlib.suppress(NotFound):
                await self._moves.thaw(name)


@contextlib.asynccontextmanager
async def joined(
    directory: DirectoryLink,
    nodes: NodeLink,
    lease: NodeLease,
    gateway: Gateway,
    ports: tuple[int, int],
    stop: Callable[[], None],
) -> AsyncIterator[NodeAgent]:
    """Makes this server a node of the cluster. `ports`: of gRPC and HTTP."""
    lease.node = lease.node.model_copy(update={"grpc_port": ports[0], "http_port": ports[1]})
    replicas, replication = Replicas(), Replication(lease, gateway.moves, nodes)
    lease.copied = replication.copied
    agent = NodeAgent(lease, gateway, directory, nodes, replicas, replication, stop)
    tasks = [
        asyncio.create_task(agent.renewing(), name="lease"),
        asyncio.create_task(replication.running(), name="replicas"),
    ]
    try:
        yield agent
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)


async def _together(
    work: Callable[[str], Awaitable[T]], names: Iterable[str], done: dict[str, T]
) -> None:
    """Does the work for scenes, which nobody enters from then on, and then for all sessions at
    once, since each session stands still until the last one is done. Results go into `done`. The
    first error is raised once all have ended.
    """
    all_names = set(names)
    for name in filter(is_scene, all_names):
        done[name] = await work(name)
    sessions = sorted(all_names - done.keys())
    found = await asyncio.gather(*map(work, sessions), return_exceptions=True)
    ended = dict(zip(sessions, found, strict=True))
    done |= {name: one for name, one in ended.items() if not isinstance(one, BaseException)}
    if failed := [one for one in found if isinstance(one, BaseException)]:
        raise failed[0]


def lease_of(plan: NodePlan, fingerprint: str) -> NodeLease:
    """The lease of this process; its ports come later."""
    node = NodeInfo(
        name=plan.name,
        number=plan.number,
        host=plan.host,
        grpc_port=0,
        http_port=0,
        fingerprint=fingerprint,
        capacity=plan.settings.limits.agents,
        machine=machine(),
        pid=os.getpid(),
    )
    return NodeLease(node)
