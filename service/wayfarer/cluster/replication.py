"""Once a second a node copies its sessions and scenes to its neighbour. Runs on the node's event
loop.

Each round sends the whole state of each session and scene. The constant content of a scene is sent
once to each neighbour. Logs of recorded sessions are not copied.
"""

import asyncio
import time
from itertools import islice
from typing import Final

import structlog

from wayfarer.cluster.messages import NodeInfo, NodeLink
from wayfarer.cluster.replicas import CONTENT, KEEP_S
from wayfarer.cluster.tenancy import Tenancy
from wayfarer.errors import WayfarerError
from wayfarer.transport.gateway.moves import SessionMoves

log = structlog.get_logger(__name__)

REPLICATE_S: Final = 1.0

BATCH_BYTES: Final = 1024 * 1024
"""Bytes of one message, somewhat exceeded."""

TOLD: Final = 4
"""Refused replicas of a round that are named in the log."""


class Replication:
    """The copies of one node at its neighbour."""

    def __init__(self, tenancy: Tenancy, moves: SessionMoves, link: NodeLink) -> None:
        self.neighbour = ""
        """Name of the node that gets the copies; empty: there is none."""
        self._tenancy = tenancy
        self._moves = moves
        self._link = link
        self._contents: dict[tuple[str, str], asyncio.Task[None]] = {}  # being sent

    async def running(self) -> None:
        """For ever."""
        while True:
            began = time.monotonic()
            nodes = self._tenancy.view.nodes
            try:
                if self.neighbour in nodes and self._tenancy.may_step():
                    await self._replicate(nodes[self.neighbour])
            except WayfarerError as error:
                log.warning("replicas not kept", neighbour=self.neighbour, reason=str(error))
            except Exception:  # else nothing would be copied any more
                log.exception("a round of copies failed", neighbour=self.neighbour)
            await asyncio.sleep(max(0.0, REPLICATE_S - (time.monotonic() - began)))

    async def _replicate(self, node: NodeInfo) -> None:
        names = [name for name in self._moves.scenes if self._moves.is_movable(name)]
        names += [name for name in self._moves.sessions if self._moves.is_movable(name)]
        # First: ended sessions make room there; a neighbour that is away fails the round at once.
        own, refused = self._tenancy.node.name, dict[str, str]()
        lacks = await self._link.call(node, "present", own, names)
        self._send_contents(node, lacks)
        batch, size = dict[str, bytes](), 0
        for number, name in enumerate(names, start=1):
            try:
                batch[name] = await self._moves.replica(name)
                size += len(batch[name])
            except WayfarerError:  # it has just ended, or moved
                pass
            except Exception:  # else nothing behind it would ever be copied
                log.exception("replica not made", session_id=name)
            if batch and (size > BATCH_BYTES or number == len(names)):
                refused |= await self._link.call(node, "keep", own, batch)
                batch, size = {}, 0
        if refused:
            told = dict(islice(refused.items(), TOLD))
            log.warning("replicas refused", neighbour=node.name, count=len(refused), first=told)

    def _send_contents(self, node: NodeInfo, lacks: set[str]) -> None:
        """Sends contents beside the copies: the neighbour answers once it has baked the scene."""
        self._contents = {key: task for key, task in self._contents.items() if not task.done()}
        for scene_id in lacks:
            if (key := (node.name, scene_id)) not in self._contents:
                sending = asyncio.create_task(self._send_content(node, scene_id), name="scene")
                self._contents[key] = sending

    async def _send_content(self, node: NodeInfo, scene_id: str) -> None:
        try:
            copy = {scene_id + CONTENT: await self._moves.content(scene_id)}
            own = self._tenancy.node.name
            refused = await self._link.call(node, "keep", own, copy, seconds=KEEP_S)
        except WayfarerError as error:
            refused = {scene_id: str(error)}
        if refused:
            log.warning("scene not copied", scene_id=scene_id, to=node.name, reason=refused)
        else:
            log.info("scene copied", scene_id=scene_id, to=node.name)
