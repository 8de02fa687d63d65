"""One subscriber's stream: chunks of the runtime as wire messages."""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Sequence
from contextlib import aclosing
from typing import Any, Final, TypeVar

from wayfarer import __version__
from wayfarer.errors import NotFound, Unavailable
from wayfarer.runtime.agent import AgentState, MotionChunk
from wayfarer.runtime.service import MotionService
from wayfarer.spec import FPS
from wayfarer.transport import convert, schema
from wayfarer.transport.basis import Basis
from wayfarer.transport.bodies import BodyLibrary
from wayfarer.transport.codec import PoseEncoder
from wayfarer.v1 import agent_pb2, catalog_pb2, common_pb2, motion_pb2

HEARTBEAT_S: Final = 1.0

_STATES: Final = {state: f"AGENT_STATE_{state.name}" for state in AgentState}
Item = TypeVar("Item")


class MotionStream:
    """Turns chunks into messages and introduces each agent before its first chunk."""

    def __init__(
        self,
        service: MotionService,
        session_id: str,
        basis: Basis,
        bodies: BodyLibrary,
        skeleton: schema.Skeleton,
        encoder: PoseEncoder,
        clock: Callable[[], float],
    ) -> None:
        self._service = service
        self._session_id = session_id
        self._basis = basis
        self._bodies = bodies
        self._skeleton = skeleton
        self._encoder = encoder
        self._clock = clock
        self._known: set[int] = set()  # aliases introduced
        self._gone: set[int] = set()  # aliases deleted: late chunks of theirs are dropped
        self._removed: list[int] = []  # deleted and not yet told

    def remove(self, alias: int) -> None:
        """Tell the client, with the next message, that an agent was deleted."""
        self._gone.add(alias)
        if alias in self._known:
            self._removed.append(alias)

    async def messages(
        self, agent_ids: Sequence[str], stop: asyncio.Event
    ) -> AsyncGenerator[motion_pb2.StreamMotionResponse]:
        """Header, then batches and heartbeats until the session ends.

        Raises NotFound at the start; Unavailable once `stop` is set. Close it with `aclose`.
        """
        subscription = await self._service.subscribe(self._session_id, agent_ids)
        try:
            yield self._response(header=self._header())
            async with aclosing(paced(aiter(subscription), HEARTBEAT_S, stop)) as batches:
                async for chunks in batches:
                    batch = await self._batch(chunks or ())
                    if batch.chunks or batch.removed:
                        yield self._response(batch=batch)
                    elif chunks is None:
                        yield self._response(heartbeat=motion_pb2.Heartbeat())
        finally:
            await subscription.close()

    def _response(self, **payload: object) -> motion_pb2.StreamMotionResponse:
        now = convert.microseconds(self._clock())
        return motion_pb2.StreamMotionResponse(sent_at_us=now, **payload)  # type: ignore[arg-type]

    def _header(self) -> motion_pb2.StreamHeader:
        return motion_pb2.StreamHeader(
            server_version=__version__,
            session_id=self._session_id,
            fps=FPS,
            basis=convert.message(common_pb2.BasisInfo, convert.basis_info(self._basis)),
            skeleton=convert.message(catalog_pb2.Skeleton, self._skeleton),
            pose_encoding=motion_pb2.POSE_ENCODING_F32_LE,
        )

    async def _batch(self, chunks: Sequence[MotionChunk]) -> motion_pb2.MotionBatch:
        added = await self._introduce(chunks)
        present = self._known - self._gone
        shown = [chunk for chunk in chunks if chunk.alias in present]
        removed, self._removed = self._removed, []
        return motion_pb2.MotionBatch(
            added=added,
            removed=removed,
            chunks=[
                motion_pb2.MotionChunk(
                    alias=chunk.alias,
                    seq=chunk.seq,
                    first_frame=chunk.first_frame,
                    scheduled_at_us=convert.microseconds(chunk.scheduled_at),
                    goal_revision=chunk.goal_revision,
                    state=_STATES[chunk.state],
                    flags=int(chunk.flags),
                    poses=packed.poses,
                    contacts=packed.contacts,
                    waypoint=chunk.waypoint,
                    candidates=chunk.candidates,
                )
                for chunk, packed in zip(
                    shown, self._encoder.encode(shown, self._basis), strict=True
                )
            ],
        )

    async def _introduce(self, chunks: Sequence[MotionChunk]) -> list[agent_pb2.Agent]:
        """Descriptions of the agents seen for the first time."""
        new = {c.alias for c in chunks} - self._known - self._gone
        if not new:
            return []
        try:
            infos = await self._service.list_agents(self._session_id)
        except NotFound:  # the session has ended since the chunks were made
            return []
        added = [info for info in infos if info.alias in new - self._gone]
        self._known.update(info.alias for info in added)
        return [
            convert.message(agent_pb2.Agent, convert.agent(info, self._basis, self._bodies))
            for info in added
        ]


async def paced(
    source: AsyncIterator[Item], interval: float, stop: asyncio.Event
) -> AsyncGenerator[Item | None]:
    """Items of `source`; None after each `interval` seconds without one.

    Raises Unavailable once `stop` is set.
    """
    stopped: asyncio.Future[Any] = asyncio.ensure_future(stop.wait())
    upcoming: asyncio.Future[Item] = asyncio.ensure_future(anext(source))
    try:
        while True:
            await asyncio.wait(
                {stopped, upcoming}, timeout=interval, return_when=asyncio.FIRST_COMPLETED
            )
            if stopped.done():
                raise Unavailable("the server is shutting down")
            if not upcoming.done():
                yield None
                continue
            try:
                item = upcoming.result()
            except StopAsyncIteration:
                return
            upcoming = asyncio.ensure_future(anext(source))
            yield item
    finally:
        stopped.cancel()
        upcoming.cancel()
        # their outcomes are taken, so that none is reported as forgotten
        await asyncio.gather(stopped, upcoming, return_exceptions=True)
