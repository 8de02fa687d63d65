"""One reader's stream: publications of the runtime as wire messages, with events and heartbeats."""

import asyncio
from collections.abc import AsyncGenerator, Callable, Collection
from contextlib import aclosing
from dataclasses import replace
from typing import Final

import numpy as np

from wayfarer.errors import NotFound, Unavailable, WayfarerError
from wayfarer.service.motion_service import MotionService
from wayfarer.service.streams.publications import Publication
from wayfarer.service.streams.subscription import Subscription
from wayfarer.transport import convert
from wayfarer.transport.batches import BatchWriter, event_message
from wayfarer.transport.framing import Part, field
from wayfarer.transport.merge import paced
from wayfarer.transport.resume import Progress
from wayfarer.v1 import motion_pb2
from wayfarer.world.agents.agent import NO_CHUNKS, AgentInfo, MotionChunks
from wayfarer.world.events import Event, EventKind

HEARTBEAT_S: Final = 1.0
SHUTDOWN: Final = "the server is shutting down"


class MotionStream:
    """Turns publications into messages and introduces each agent before its first chunk."""

    def __init__(
        self,
        service: MotionService,
        session_id: str,
        subscription: Subscription,
        clock: Callable[[], float],
        followed: str = "",
        since: Progress | None = None,
        gone: Collection[int] = (),
    ) -> None:
        """`followed`: see `filter_mark`. `since`: how far the reader's earlier stream had come.

        `gone`: aliases of deleted agents that it may still show.
        """
        self._service = service
        self._session_id = session_id
        self._subscription = subscription
        self._clock = clock
        self._ended = asyncio.Event()
        self._error: WayfarerError | None = None
        self._followed = followed
        self._since = since
        self._token = ""  # of what has been sent
        self._known: dict[int, str] = {}  # agents introduced, by alias
        self._gone = set(gone)  # aliases deleted: late chunks of theirs are dropped
        self._removed = list(gone)  # deleted and not yet reported

    def remove(self, alias: int) -> None:
        """Tell the reader, with the next message, that an agent was deleted."""
        self._gone.add(alias)
        if alias in self._known:
            self._removed.append(alias)

    def end(self, error: WayfarerError) -> bool:
        """End it with `error`; False when it was ending already."""
        if self._error is not None:
            return False
        self._error = error
        self._ended.set()
        return True

    def ack(self, token: str, playhead: float) -> None:
        """The reader has received all up to `token` and shows the moment `playhead` (Unix s).

        Raises InvalidArgument.
        """
        progress = Progress.read(token)
        if progress is not None and progress.epoch == self._subscription.epoch:
            self._subscription.ack(progress.position, playhead)

    async def messages(self, writer: BatchWriter, resume_s: float) -> AsyncGenerator[bytes]:
        """Header, then batches, events and heartbeats until the session ends: each a
        StreamMotionResponse, encoded.

        Raises what it was ended with; Unavailable after an event that says so. Close it with
        `aclose`.
        """
        header = writer.header(self._session_id, resume_s, self._subscription.resumed)
        yield self._response(header=header)
        async with aclosing(self._publications()) as publications:
            async for published in publications:
                chunks, events = self._fresh(published) if published else (NO_CHUNKS, [])
                shown, added = await self._introduce(chunks)
                if published:
                    self._token = self._progress(published, 0 if events else None)
                if shown or self._removed:
                    removed, self._removed = self._removed, []
                    yield self._batch(writer.batch(shown, added, removed, self._token))
                elif not events:
                    yield self._response(heartbeat=motion_pb2.Heartbeat())
                for token, event in events:
                    yield self._response(event=event_message(self._aliased(event)))
                    self._token = token
                    if event.kind is EventKind.AGENT_LEFT:
                        self._leave(event.agent_id)
        if self._error:
            if isinstance(self._error, Unavailable):
                yield self._response(event=event_message(self._draining()))
            raise self._error

    async def events(self) -> AsyncGenerator[tuple[str, Event] | None]:
        """Events alone, each with its resume token; None at once, and when nothing else happens.

        Raises what it was ended with; Unavailable after an event that says so. Close it with
        `aclose`.
        """
        yield None
        async with aclosing(self._publications()) as publications:
            async for published in publications:
                if published is None:
                    yield None
                    continue
                for token, event in self._fresh(published)[1]:
                    yield token, event
        if self._error:
            if isinstance(self._error, Unavailable):
                yield "", self._draining()
            raise self._error

    def _aliased(self, event: Event) -> Event:
        """The event with its alias: the runtime knows only the id of an agent that has left."""
        if event.kind is not EventKind.AGENT_LEFT:
            return event
        return replace(event, alias=self._alias(event.agent_id))

    def _leave(self, agent_id: str) -> None:
        if alias := self._alias(agent_id):
            self.remove(alias)

    def _alias(self, agent_id: str) -> int:
        """The alias of an agent that has been introduced; else 0."""
        return next((alias for alias, name in self._known.items() if name == agent_id), 0)

    def _publications(self) -> AsyncGenerator[Publication | None]:
        return paced(aiter(self._subscription), HEARTBEAT_S, self._ended)

    def _response(self, **payload: object) -> bytes:
        now = convert.microseconds(self._clock())
        message = motion_pb2.StreamMotionResponse(sent_at_us=now, **payload)  # type: ignore[arg-type]
        return message.SerializeToString()

    def _batch(self, batch: list[Part]) -> bytes:
        payload = field(motion_pb2.StreamMotionResponse.BATCH_FIELD_NUMBER, batch)
        return b"".join([self._response(), *payload])

    def _draining(self) -> Event:
        return Event(EventKind.DRAINING, self._clock(), detail=SHUTDOWN)

    def _progress(self, published: Publication, events: int | None) -> str:
        """The resume token after `events` events of a publication; None: after all of it."""
        position = published.position
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
            self._since = None  # news of a loss may come with the same position later
            return NO_CHUNKS, events[since.events :]
        return published.chunks, events

    async def _introduce(self, chunks: MotionChunks) -> tuple[MotionChunks, list[AgentInfo]]:
        """The chunks to show, and descriptions of the agents seen for the first time."""
        present = set(chunks.alias.tolist())
        added = []
        if new := present - self._known.keys() - self._gone:
            try:
                infos = await self._service.list_agents(self._session_id)
            except NotFound:  # the session has ended since the chunks were made
                infos = []
            added = [info for info in infos if info.alias in new - self._gone]
            self._known.update((info.alias, info.agent_id) for info in added)
        shown = (present & self._known.keys()) - self._gone
        if len(shown) < len(present):
            chunks = chunks.take(np.flatnonzero(np.isin(chunks.alias, list(shown))))
        return chunks, added
