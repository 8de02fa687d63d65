"""Once a second a node copies its sessions and scenes to its neighbour. Runs on the node's event
loop.

The state of a session or scene is sent whole each time. What never changes of a scene is sent once
to each neighbour, and of the log of a recorded session what is new.
"""

import asyncio
import time
from dataclasses import dataclass
from itertools import islice
from typing import Final

import structlog

from wayfarer.cluster.messages import NodeInfo, NodeLink
from wayfarer.cluster.tenancy import Tenancy
from wayfarer.errors import WayfarerError
from wayfarer.runtime.persistence.record import UNCOPIED, LogMark
from wayfarer.transport.gateway.moves import SessionMoves

log = structlog.get_logger(__name__)

REPLICATE_S: Final = 1.0

LOG_PART_BYTES: Final = 32 * 1024 * 1024
"""A log that has grown by more since its last copy is not copied: no message would take it."""

BATCH_BYTES: Final = 1024 * 1024
"""Bytes of one message, somewhat exceeded."""

PREPARE_S: Final = 60.0
"""Seconds within which a scene is baked."""

TOLD: Final = 4
"""Refused replicas of a round that are named in the log."""


@dataclass(frozen=True, slots=True)
class _LogCopy:
    """The parts of a log that the neighbour has."""

    parts: int = 0
    mark: LogMark = UNCOPIED
    refused: bool = False  # there is no room for it


@dataclass(frozen=True, slots=True)
class _Copy:
    """A copy that is sent."""

    state: bytes
    part: bytes  # of its log
    after: int  # number of parts before it
    known: _LogCopy  # before
    mark: LogMark  # of the log, with this part
    sent: int  # parts, if all arrive; -1: the log is too large


class Replication:
    """The copies of one node at its neighbour."""

    def __init__(self, tenancy: Tenancy, moves: SessionMoves, link: NodeLink) -> None:
        self.neighbour = ""
        """Name of the node that gets the copies; empty: there is none."""
        self._tenancy = tenancy
        self._moves = moves
        self._link = link
        self._contents: dict[str, asyncio.Task[None]] = {}  # of scenes, by neighbour and scene
        self._logs: dict[str, _LogCopy] = {}  # by neighbour and session

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
        keys = {_key(node, name) for name in names}
        self._logs = {key: known for key, known in self._logs.items() if key in keys}
        # First: ended sessions make room there; a neighbour that is away fails the round at once.
        own, refused = self._tenancy.node.name, dict[str, str]()
        await self._link.call(node, "present", own, names)
        batch, size = dict[str, _Copy](), 0
        for number, name in enumerate(names, start=1):
            try:
                made = await self._copy(node, name)
            except Exception:  # else nothing behind it would ever be copied
                log.exception("replica not made", session_id=name)
                made = None
            if made is not None:
                batch[name] = made
                size += len(made.state) + len(made.part)
            if batch and (size > BATCH_BYTES or number == len(names)):
                copies = {key: (one.state, one.part, one.after) for key, one in batch.items()}
                kept = await self._link.call(node, "keep", own, copies)
                for key, one in batch.items():
                    refused |= self._heard(node, key, one, kept[key])
                batch, size = {}, 0
        if refused:
            told = dict(islice(refused.items(), TOLD))
            log.warning("replicas refused", neighbour=node.name, count=len(refused), first=told)

    async def _copy(self, node: NodeInfo, name: str) -> "_Copy | None":
        """None: it has just ended, or moved."""
        # if this fails, it is not known what has arrived
        known = self._logs.pop(_key(node, name), _LogCopy())
        try:
            made = await self._moves.replica(name, None if known.refused else known.mark)
        except WayfarerError:
            return None
        # another log than before, of a session with the same id, begins again
        after = known.parts if made.mark.log_id == known.mark.log_id else 0
        if len(made.log_part) > LOG_PART_BYTES:
            return _Copy(made.state, b"", after, known, UNCOPIED, -1)
        sent = after + bool(made.log_part)
        return _Copy(made.state, made.log_part, after, known, made.mark, sent)

    def _heard(self, node: NodeInfo, name: str, one: "_Copy", kept: int | str) -> dict[str, str]:
        """Notes the parts that the neighbour has now, or returns its reason for a refusal."""
        if isinstance(kept, str):
            return {name: kept}
        if one.known.refused:
            self._logs[_key(node, name)] = one.known
        elif kept == one.sent:
            self._logs[_key(node, name)] = _LogCopy(kept, one.mark)
        elif not one.after:
            log.warning("log not copied: it is too large", session_id=name, neighbour=node.name)
            self._logs[_key(node, name)] = _LogCopy(refused=True)
        return {}

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
