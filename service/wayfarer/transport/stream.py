"""One reader's stream: publications of the runtime as wire messages, with events and heartbeats."""

import asyncio
from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import aclosing
from typing import Final

from wayfarer.errors import NotFound, Unavailable
from wayfarer.runtime.agent import AgentInfo, Event, EventKind, MotionChunk, Publication
from wayfarer.runtime.service import MotionService, Subscription
from wayfarer.transport import convert
from wayfarer.transport.batches import BatchWriter, event_message
from wayfarer.transport.merge import paced
from wayfarer.transport.resume import Progress
from wayfarer.v1 import motion_pb2

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
        stop: asyncio.Event,
        since: Progress | None = None,
    ) -> None:
        """`stop` ends it; `since`: how far the reader's earlier stream had come."""
        self._service = service
        self._session_id = session_id
        self._subscription = subscription
        self._clock = clock
        self._stop = stop
        self._since = since
        self._token = ""  # of what has been sent
        self._known: set[int] = set()  # aliases introduced
        self._gone: set[int] = set()  # aliases deleted: late chunks of theirs are dropped
        self._removed: list[int] = []  # deleted and not yet told

    def remove(self, alias: int) -> None:
        """Tell the reader, with the next message, that an agent was deleted."""
        self._gone.add(alias)
        if alias in self._known:
            self._removed.append(alias)

    def ack(self, token: str, playhead: float) -> None:
        """The reader has received all up to `token` and shows the moment `playhead` (Unix s).

        Raises InvalidArgument.
        """
        progress = Progress.read(token)
        if progress is not None and progress.epoch == self._subscription.epoch:
            self._subscription.ack(progress.position, playhead)

    async def messages(
        self, writer: BatchWriter, resume_s: float
    ) -> AsyncGenerator[motion_pb2.StreamMotionResponse]:
        """Header, then batches, events and heartbeats until the session ends.

        Raises Unavailable once it is stopped, after an event that says so. Close it with `aclose`.
        """
        header = writer.header(self._session_id, resume_s, self._subscription.resumed)
        yield self._response(header=header)
        async with aclosing(self._publications()) as publications:
            async for published in publications:
                chunks, events = self._fresh(published) if published else ((), [])
                shown, added = await self._introduce(chunks)
                if published:
                    self._token = Progress(
                        self._subscription.epoch, published.position, 0 if events else None
                    ).token()
                if shown or self._removed:
                    removed, self._removed = self._removed, []
                    yield self._response(batch=writer.batch(shown, added, removed, self._token))
                elif not events:
                    yield self._response(heartbeat=motion_pb2.Heartbeat())
                for token, event in events:
                    yield self._response(event=event_message(event))
                    self._token = token
        if self._stop.is_set():
            yield self._response(event=event_message(self._draining()))
            raise Unavailable(SHUTDOWN)

    async def events(self) -> AsyncGenerator[tuple[str, Event] | None]:
        """Events alone, each with its resume token; None at once, and when nothing else happens.

        Raises Unavailable once it is stopped, after an event that says so. Close it with `aclose`.
        """
        yield None
        async with aclosing(self._publications()) as publications:
            async for published in publications:
                if published is None:
                    yield None
                    continue
                for token, event in self._fresh(published)[1]:
                    yield token, event
        if self._stop.is_set():
            yield "", self._draining()
            raise Unavailable(SHUTDOWN)

    def _publications(self) -> AsyncGenerator[Publication | None]:
        return paced(aiter(self._subscription), HEARTBEAT_S, self._stop)

    def _response(self, **payload: object) -> motion_pb2.StreamMotionResponse:
        now = convert.microseconds(self._clock())
        return motion_pb2.StreamMotionResponse(sent_at_us=now, **payload)  # type: ignore[arg-type]

    def _draining(self) -> Event:
        return Event(EventKind.DRAINING, self._clock(), detail=SHUTDOWN)

    def _fresh(
        self, published: Publication
    ) -> tuple[Sequence[MotionChunk], list[tuple[str, Event]]]:
        """What the reader has not yet had of a publication; each event with its resume token."""
        epoch, last = self._subscription.epoch, len(published.events)
        events = [
            (Progress(epoch, published.position, None if i == last else i).token(), event)
            for i, event in enumerate(published.events, start=1)
        ]
        since = self._since
        if since and since.epoch == epoch and since.position == published.position:
            self._since = None  # news of a loss may come with the same position later
            return (), events[since.events :]
        return published.chunks, events

    async def _introduce(
        self, chunks: Sequence[MotionChunk]
    ) -> tuple[list[MotionChunk], list[AgentInfo]]:
        """The chunks to show, and descriptions of the agents seen for the first time."""
        added = []
        if new := {c.alias for c in chunks} - self._known - self._gone:
            try:
                infos = await self._service.list_agents(self._session_id)
            except NotFound:  # the session has ended since the chunks were made
                infos = []
            added = [info for info in infos if info.alias in new - self._gone]
            self._known.update(info.alias for info in added)
        return [c for c in chunks if c.alias in self._known - self._gone], added
