"""Once a second a node copies its sessions and scenes to its neighbour. Runs on the node's event
loop.

The state of a session or scene is sent whole each time, and what never changes of a scene once to
each neighbour. The log of a recorded session is not copied.
"""

import asyncio
import time
from itertools import islice
from typing import Final

import structlog

from wayfarer.cluster.messages import NodeInfo, NodeLink
from wayfarer.cluster.tenancy import Tenancy
from wayfarer.errors import WayfarerError
from wayfarer.transport.gateway.moves import SessionMoves

log = structlog.get_logger(__name__)

REPLICATE_S: Final = 1.0

BATCH_BYTES: Final = 1024 * 1024
"""Bytes of one message, somewhat exceeded."""

PREPARE_S: Final = 60.0
"""Seconds within which a scene is baked."""

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
        self._contents: dict[str, asyncio.Task[None]] = {}  # of scenes, by neighbour and scene

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
        self._send_content(node)
        # First: ended sessions make room there; a neighbour that is away fails the round at once.
        own, refused = self._tenancy.node.name, dict[str, str]()
        await self._link.call(node, "present", own, names)
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

    # Scenes

    def _send_content(self, node: NodeInfo) -> None:
        """Sends each scene once to a life of the neighbour, which bakes it meanwhile."""
        here = {_key(node, scene_id): scene_id for scene_id in self._moves.scenes}
        for key, sending in list(self._contents.items()):
            if key not in here or (sending.done() and sending.exception() is not None):
                sending.cancel()
                del self._contents[key]
        for key in here.keys() - self._contents.keys():
            work = self._send_scene(node, here[key])
            self._contents[key] = asyncio.create_task(work, name="scene")

    async def _send_scene(self, node: NodeInfo, scene_id: str) -> None:
        try:
            content = await self._moves.content(scene_id)
            told = self._tenancy.node.name, scene_id, content
            await self._link.call(node, "prepare", *told, seconds=PREPARE_S)
            log.info("scene copied", scene_id=scene_id, to=node.name)
        except WayfarerError as error:
            log.warning("scene not copied", scene_id=scene_id, reason=str(error))
            raise


def _key(node: NodeInfo, name: str) -> str:
    """A session or scene with this life of a neighbour."""
    return f"{node.name} {name}"
