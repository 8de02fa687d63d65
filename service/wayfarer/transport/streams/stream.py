"""One reader's stream: publications of the runtime as wire messages, with events and heartbeats."""

import asyncio
from collections.abc import AsyncGenerator, Callable, Collection, Mapping, Sequence
from contextlib import aclosing
from dataclasses import replace
from typing import Final

import numpy as np

from wayfarer.errors import InvalidArgument, NotFound, Unavailable, WayfarerError
from wayfarer.runtime.motion_service import MotionService
from wayfarer.runtime.streams.publications import Publication
from wayfarer.runtime.streams.root_tracks import Roots
from wayfarer.runtime.streams.subscription import Subscription
from wayfarer.transport import schema
from wayfarer.transport.conversion import convert
from wayfarer.transport.conversion.basis import Axes, Basis
from wayfarer.transport.streams.batches import BatchWriter, event_message
from wayfarer.transport.streams.detail_levels import DetailLevels
from wayfarer.transport.streams.framing import Part, field
from wayfarer.transport.streams.resume import Progress
from wayfarer.transport.streams.sized_batches import (
    NO_ROWS,
    SizedBatches,
    VisibleChunks,
    WrittenBatch,
)
from wayfarer.v1 import motion_pb2
from wayfarer.world.agents.agent import NO_CHUNKS, AgentInfo, ChunkFlag, MotionChunks
from wayfarer.world.events import Event, EventKind

HEARTBEAT_S: Final = 1.0

FEW: Final = 8
"""Maximum number of agents that are looked up one by one; otherwise the session's are listed."""

SHUTDOWN: Final = "the server is shutting down"


class MotionStream:
    """Turns publications into messages. The batch with an agent's first chunk introduces it."""

    def __init__(
        self,
        service: MotionService,
        session_id: str,
        subscription: Subscription,
        clock: Callable[[], float],
        followed: str = "",
        since: Progress | None = None,
        gone: Collection[int] = (),
        interest: DetailLevels | None = None,
        axes: Axes = Basis.GLTF.axes,
    ) -> None:
        """`followed`: see `filter_mark`. `since`: progress of the reader's earlier stream.

        `gone`: aliases of deleted agents that the reader may still show. `interest`: rings and
        viewpoints; None: all agents have the same detail. `axes`: of the session's basis.
        """
        self._service = service
        self._session_id = session_id
        self._subscription = subscription
        self._clock = clock
        self._error: WayfarerError | None = None
        self._followed = followed
        self._since = since
        self._resumes = since is not None  # the reader may show agents that were not introduced
        self._token = ""  # of what has been sent
        self._interest, self._axes = interest, axes
        self._count = 1  # number of tiers; as a tier, this number means out of sight
        if interest is not None:
            self._count = len(interest.rings)
            interest.resumed = subscription.resumed
        self._sent_at = clock()
        self._known: set[int] = set()  # aliases of agents that were introduced
        self._seen: set[int] = set()  # aliases of those that are within the rings
        self._gone = set(gone)  # deleted aliases, whose late chunks are dropped
        self._removed = list(gone)  # deleted and not yet reported

    def remove(self, alias: int) -> None:
        """Reports a deleted agent to the reader with the next message."""
        self._leave(alias)
        self._gone.add(alias)

    def end(self, error: WayfarerError) -> bool:
        """Ends the stream with `error`; returns False if it was ending already."""
        if self._error is not None:
            return False
        self._error = error
        self._subscription.end()
        return True

    def ack(self, token: str, playhead: float) -> None:
        """Records that the reader has received everything up to `token` and shows the moment
        `playhead` (Unix s).

        Raises InvalidArgument.
        """
        progress = Progress.read(token)
        if progress is not None and progress.epoch == self._subscription.epoch:
            self._subscription.ack(progress.position, playhead)

    def look(self, viewpoints: schema.Viewpoints) -> None:
        """Sets the viewpoints from the next batch on.

        Raises InvalidArgument, also for a stream without rings.
        """
        if self._interest is None:
            raise InvalidArgument("the stream was opened without `interest`", "viewpoints")
        self._interest.look(convert.viewpoints(viewpoints.viewpoints, self._axes))

    async def messages(
        self, writers: Sequence[BatchWriter], resume_s: float, most: int = 0
    ) -> AsyncGenerator[bytes]:
        """Yields a header, then batches, events and heartbeats until the session ends: each an
        encoded StreamMotionResponse.

        `writers`: one for each ring, or one alone. `most`: maximum bytes of a message; 0: no limit.
        Raises the subscription's error, or that of `end`: an event DRAINING comes before the latter
        if it is Unavailable. Close it with `aclose`.
        """
        yield self._response(header=self._header(writers, resume_s))
        sized = SizedBatches(writers, most)
        async with aclosing(self._publications()) as publications:
            async for published in publications:
                chunks, events = self._fresh(published) if published else (NO_CHUNKS, [])
                shown = await self._show(chunks, published.roots if published else None)
                before = self._token
                if published:
                    before = self._progress(published, None, -1)
                    self._token = self._progress(published, 0 if events else None)
                if self._interest is not None:
                    hidden = int(np.count_nonzero(shown.tiers == self._count))
                    self._subscription.meter.sent("hidden", hidden, 0)
                if batches := sized.batches(shown, self._removed, before, self._token):
                    self._removed = []
                    for batch in batches:
                        message = self._batch(batch.parts)
                        self._count_sent(batch, len(message))
                        yield message
                elif published and self._interest:
                    # no agent is in sight; now and then the reader gets a token to resume from
                    if self._clock() - self._sent_at >= HEARTBEAT_S:
                        empty = motion_pb2.MotionBatch(resume_token=self._token)
                        yield self._batch([empty.SerializeToString()])
                elif not events:
                    yield self._response(heartbeat=motion_pb2.Heartbeat())
                for token, event in events:
                    yield self._response(event=event_message(event, self._axes))
                    self._token = token
                    if event.kind is EventKind.AGENT_LEFT:  # no chunk of the agent comes after that
                        self._leave(event.alias)
        if self._error:
            if isinstance(self._error, Unavailable):
                yield self._response(event=event_message(self._draining(), self._axes))
            raise self._error

    async def events(self) -> AsyncGenerator[tuple[str, motion_pb2.Event] | None]:
        """Yields only events, each with its resume token; None at once, and as a heartbeat.

        Raises the subscription's error, or that of `end`: an event DRAINING comes before the latter
        if it is Unavailable. Close it with `aclose`.
        """
        yield None
        async with aclosing(self._publications()) as publications:
            async for published in publications:
                for token, event in self._fresh(published)[1] if published else []:
                    self._sent_at = self._clock()
                    yield token, event_message(event, self._axes)
                # while agents move, publications without events follow each other
                if published is None or self._clock() - self._sent_at >= HEARTBEAT_S:
                    self._sent_at = self._clock()
                    yield None
        if self._error:
            if isinstance(self._error, Unavailable):
                yield "", event_message(self._draining(), self._axes)
            raise self._error

    def _count_sent(self, batch: WrittenBatch, size: int) -> None:
        tier = "whole" if self._interest is None else str(batch.tier)
        self._subscription.meter.sent(tier, batch.chunks, size)

    def _leave(self, alias: int) -> None:
        """Forgets a deleted agent, and reports it to a reader that may show it."""
        if alias in self._known or (self._resumes and alias not in self._gone):
            self._removed.append(alias)
        self._known.discard(alias)
        self._seen.discard(alias)
        if self._interest is not None:
            self._interest.forget(alias)

    async def _publications(self) -> AsyncGenerator[Publication | None]:
        """Yields publications, and None after each `HEARTBEAT_S` without one, until `end`."""
        while self._error is None:
            published = None
            try:
                async with asyncio.timeout(HEARTBEAT_S):
                    published = await anext(self._subscription)
            except TimeoutError:
                pass
            except StopAsyncIteration:
                return
            if self._error is None:
                yield published

    def _response(self, **payload: object) -> bytes:
        self._sent_at = self._clock()
        now = convert.microseconds(self._sent_at)
        message = motion_pb2.StreamMotionResponse(sent_at_us=now, **payload)  # type: ignore[arg-type]
        return message.SerializeToString()

    def _batch(self, batch: list[Part]) -> bytes:
        payload = field(motion_pb2.StreamMotionResponse.BATCH_FIELD_NUMBER, batch)
        return b"".join([self._response(), *payload])

    def _draining(self) -> Event:
        return Event(EventKind.DRAINING, self._clock(), detail=SHUTDOWN)

    def _header(self, writers: Sequence[BatchWriter], resume_s: float) -> motion_pb2.StreamHeader:
        header = writers[0].header(self._session_id, resume_s, self._subscription.resumed)
        if self._interest is not None:
            pairs = zip(writers, self._interest.rings, strict=True)
            header.tiers.extend(writer.tier(ring.radius) for writer, ring in pairs)
        return header

    def _progress(self, published: Publication, events: int | None, later: int = 0) -> str:
        """The resume token after `events` events of a publication; None: after all of it.

        `later`: takes the publication that is this many positions later; -1: the one before.
        """
        position = published.position + later
        return Progress(self._subscription.epoch, position, events, self._followed).token()

    def _fresh(self, published: Publication) -> tuple[MotionChunks, list[tuple[str, Event]]]:
        """The part of a publication that is new to the reader; each event with its resume token."""
        epoch, last = self._subscription.epoch, len(published.events)
        events = [
            (self._progress(published, None if i == last else i), event)
            for i, event in enumerate(published.events, start=1)
        ]
        since = self._since
        if since and since.epoch == epoch and since.position == published.position:
            self._since = None  # the report of a loss may come later with the same position
            return NO_CHUNKS, events[since.events :]
        return published.chunks, events

    async def _show(self, chunks: MotionChunks, roots: Roots | None) -> VisibleChunks:
        """What to send of chunks and their `roots`: tiers, and descriptions of the agents that the
        reader does not see yet.
        """
        if not chunks:
            return VisibleChunks(chunks, NO_ROWS)
        aliases = chunks.alias.tolist()
        tiers, left = np.zeros(len(aliases), np.intp), list[int]()
        if self._interest is not None:
            tiers, entered, left = self._interest.sort(chunks)
            for alias in self._gone.intersection(aliases):  # late chunks
                self._interest.forget(alias)
            chunks = replace(chunks, flags=chunks.flags | entered * np.uint8(ChunkFlag.FIRST))
            self._seen.difference_update(left)
        within = zip(aliases, chunks.agent_id, tiers < self._count, strict=True)
        new = {alias: name for alias, name, is_in in within if is_in and alias not in self._seen}
        added = await self._introduce(new) if new else {}
        if new.keys() - added.keys():  # these have been deleted
            tiers = np.where([alias in self._seen for alias in aliases], tiers, self._count)
        return VisibleChunks(chunks, tiers, roots, added, [a for a in left if a not in self._gone])

    async def _introduce(self, agents: Mapping[int, str]) -> dict[int, AgentInfo]:
        """Descriptions of the agents that still exist; `agents` has ids by alias."""
        agents = {alias: name for alias, name in agents.items() if alias not in self._gone}
        if len(agents) > FEW:
            try:
                infos = await self._service.list_agents(self._session_id)
            except NotFound:  # the session has ended since the chunks were made
                infos = []
        else:
            infos = [info for name in agents.values() if (info := await self._agent(name))]
        wanted = agents.keys() - self._gone  # some may have been deleted meanwhile
        found = {info.alias: info for info in infos if info.alias in wanted}
        self._known |= found.keys()
        self._seen |= found.keys()
        return found

    async def _agent(self, agent_id: str) -> AgentInfo | None:
        try:
            return await self._service.get_agent(agent_id)
        except NotFound:
            return None
