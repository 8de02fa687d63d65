"""A node copies its sessions and scenes to its neighbour: all of them once a second. What a call
makes, changes or deletes is also copied before its answer, within `COPY_S`; goals do not wait. Runs
on the node's event loop.

A copy is the whole state of a session or scene. The constant content of a scene is sent once to
each neighbour, with its baked ground. Logs of recorded sessions are not copied.
"""

import asyncio
import contextlib
from collections.abc import Collection, Sequence
from itertools import islice
from typing import Final

import structlog

from wayfarer.cluster.messages import NodeInfo, NodeLink
from wayfarer.cluster.node_lease import NodeLease
from wayfarer.cluster.replicas import CONTENT
from wayfarer.errors import WayfarerError
from wayfarer.ids import group_of
from wayfarer.transport.gateway.moves import SessionMoves

log = structlog.get_logger(__name__)

REPLICATE_S: Final = 1.0

AT_ONCE: Final = 16
"""Maximum number of sessions and scenes in a message of a round. Copies that calls wait for come in
between."""

SEND_S: Final = 3.0
"""Seconds to wait for the neighbour's answer to a message: roughly one lease, after which a silent
neighbour is replaced."""

STATE_S: Final = 2.0
"""Seconds to wait for a state: while a session in lock-step makes many steps its state is not
there, and the other sessions must not wait for it."""

COPY_S: Final = 8.0
"""Maximum seconds that a call waits for its copy: by then a silent neighbour has been replaced."""

AGAIN_S: Final = 0.25
"""Seconds until a copy that a call waits for is tried again, maybe with another neighbour."""

TOLD: Final = 4
"""Maximum number of refused replicas of a message that the log names."""


class Replication:
    """The copies of one node at its neighbour."""

    def __init__(self, lease: NodeLease, moves: SessionMoves, link: NodeLink) -> None:
        self.neighbour = ""
        """Name of the node that gets the copies; empty: there is none."""
        self._lease = lease
        self._moves = moves
        self._link = link
        self._sending = asyncio.Lock()  # otherwise an older state could arrive after a newer one
        self._due = set[str]()  # names whose copies calls wait for

    async def running(self) -> None:
        """Copies everything, round after round, until it is cancelled."""
        now = asyncio.get_running_loop().time
        while True:
            began = now()
            try:
                await self._round(self._names())
            except WayfarerError as error:
                log.warning("replicas not kept", neighbour=self.neighbour, reason=str(error))
            except Exception:  # otherwise nothing would be copied any more
                log.exception("a round of copies failed", neighbour=self.neighbour)
            await asyncio.sleep(max(0.0, REPLICATE_S - (now() - began)))

    async def _round(self, names: Sequence[str]) -> None:
        for first in range(0, len(names) or 1, AT_ONCE):  # also tells that there is none
            async with self._sending:
                await self._send(names[first : first + AT_ONCE])

    async def copied(self, name: str) -> None:
        """Returns once the present state of a session or scene has been sent to the neighbour, or
        the neighbour knows that it has ended. A state that is refused or not available counts as
        sent. Returns at once without a neighbour or a lease, and after `COPY_S` at the latest.
        """
        self._due.add(name)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(COPY_S):
                while not await self._sent(name):
                    await asyncio.sleep(AGAIN_S)

    async def _sent(self, name: str) -> bool:
        """Sends all due copies in one message, unless the copy of `name` was sent meanwhile.
        Returns whether that copy was sent.
        """
        async with self._sending:
            if name not in self._due:  # was sent for another call, after this one had asked
                return True
            due, self._due = self._due, set()
            try:
                await self._send(due)
            except BaseException as error:
                self._due |= due
                if not isinstance(error, WayfarerError):
                    raise
                log.warning("copy not kept", neighbour=self.neighbour, reason=str(error))
                return False
            return True

    def _names(self) -> list[str]:
        """Names of all scenes and sessions. Scenes come first, since sessions need them."""
        return [*filter(self._moves.is_movable, (*self._moves.scenes, *self._moves.sessions))]

    async def _send(self, names: Collection[str]) -> None:
        """Sends the neighbour the names of all sessions and scenes, and the states of `names`."""
        node = self._lease.view.nodes.get(self.neighbour)
        if node is None or not self._lease.may_step():
            return
        # First: ended sessions make room there; it fails at once if the neighbour is away.
        own, present = self._lease.node.name, [*self._names(), *self._lease.names_coming]
        lacks = await self._link.call(node, "present", own, present, seconds=SEND_S)
        groups = set(map(group_of, names))
        for scene_id in [one for one in lacks if group_of(one) in groups]:
            await self._send_content(node, scene_id)
        due = [name for name in present if name in names]
        states = await asyncio.gather(*map(self._state, due))
        batch = {name: state for name, state in zip(due, states, strict=True) if state}
        refused = await self._link.call(node, "keep", own, batch, seconds=SEND_S) if batch else {}
        if refused:
            told = dict(islice(refused.items(), TOLD))
            log.warning("replicas refused", neighbour=node.name, count=len(refused), first=told)

    async def _state(self, name: str) -> bytes:
        """The state; empty for a session that has just ended or moved, or is busy."""
        try:
            async with asyncio.timeout(STATE_S):
                return await self._moves.replica(name)
        except (WayfarerError, TimeoutError):
            pass
        except Exception:  # the others are copied all the same
            log.exception("replica not made", session_id=name)
        return b""

    async def _send_content(self, node: NodeInfo, scene_id: str) -> None:
        own, name = self._lease.node.name, scene_id + CONTENT
        copy = {name: await self._moves.content(scene_id)}
        refused = await self._link.call(node, "keep", own, copy, seconds=SEND_S)
        if refused:
            log.warning("scene not copied", scene_id=scene_id, to=node.name, reason=refused[name])
            return
        log.info("scene copied", scene_id=scene_id, to=node.name)
