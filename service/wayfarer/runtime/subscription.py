"""A subscriber's bounded queue of chunk batches. Lives on the subscriber's event loop."""

import asyncio
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Self

from wayfarer.errors import FailedPrecondition, WayfarerError
from wayfarer.runtime.agent import ChunkFlag, MotionChunk

MIN_BATCHES = 3
"""Never dropped below this, however far apart the batches are in time."""

Batch = Sequence[MotionChunk]


class ChunkQueue:
    """Implements `Subscription`: bounded in time; when full it loses the oldest batch.

    A chunk that follows a lost one carries GAP, an agent's first one FIRST.
    """

    def __init__(self, session_id: str, agent_ids: frozenset[str], seconds: float) -> None:
        """Must be made on the reader's event loop. No `agent_ids`: all of the session."""
        self.session_id = session_id
        self.agent_ids = agent_ids
        self.loop = asyncio.get_running_loop()
        self.closed = False  # read by the motion thread, which then forgets the queue
        self.dropped = 0  # batches lost so far
        self._seconds = seconds
        self._batches: deque[Batch] = deque()
        self._ended = False
        self._error: WayfarerError | None = None
        self._waiter: asyncio.Future[None] | None = None
        self._last_seq: dict[str, int] = {}

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Batch:
        """Next batch. Raises StopAsyncIteration at the end, Unavailable if the loop failed."""
        while not self._batches:
            if self._error is not None:
                raise self._error
            if self._ended:
                raise StopAsyncIteration
            if self._waiter is not None:
                raise FailedPrecondition("a subscription has one reader; another one is waiting")
            self._waiter = self.loop.create_future()
            try:
                await self._waiter
            finally:
                self._waiter = None
        return [self._mark(chunk) for chunk in self._batches.popleft()]

    async def close(self) -> None:
        """Stop receiving. Safe to call twice."""
        self.closed = True
        self._batches.clear()
        self.end()

    def put(self, batch: Batch) -> None:
        """Add a batch; lose the oldest ones beyond the bound. On the reader's event loop."""
        if self.closed:
            return
        self._batches.append(batch)
        while len(self._batches) > MIN_BATCHES and self._span() > self._seconds:
            self._batches.popleft()
            self.dropped += 1
        self._wake()

    def end(self, error: WayfarerError | None = None) -> None:
        """No batch follows; the reader still gets those that wait."""
        self._ended = True
        self._error = error
        self._wake()

    def _span(self) -> float:
        return self._batches[-1][0].scheduled_at - self._batches[0][0].scheduled_at

    def _wake(self) -> None:
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_result(None)

    def _mark(self, chunk: MotionChunk) -> MotionChunk:
        last = self._last_seq.get(chunk.agent_id)
        self._last_seq[chunk.agent_id] = chunk.seq
        if last is None:
            return replace(chunk, flags=chunk.flags | ChunkFlag.FIRST)
        if chunk.seq != last + 1:
            return replace(chunk, flags=chunk.flags | ChunkFlag.GAP)
        return chunk
