"""A stream that is opened again where it left off when its connection is lost."""

import asyncio
from collections.abc import AsyncGenerator
from types import TracebackType
from typing import Any, Final, Self

import grpc

from wayfarer_client.connection import Backoff, Connection, goes_on
from wayfarer_client.errors import (
    Misdirected,
    ResourceExhausted,
    Unavailable,
    WayfarerError,
    from_grpc,
)
from wayfarer_client.homes import Route
from wayfarer_client.messages import Batch, StreamInfo
from wayfarer_client.v1 import motion_pb2
from wayfarer_client.wire import BatchReader

SILENCE_S: Final = 2.5
"""Seconds after which a stream without even a heartbeat (one per second) is dead."""


class MotionStream:
    """The batches of a session, as an asynchronous iterator. End it with `aclose`, or `async with`.

    A lost connection is restored, for `deadline` seconds from the last sign of life; then
    Unavailable is raised. The stream continues without a gap while the server still holds what was
    missed; otherwise an event of kind "gap" reports it, and agents continue with Flag.GAP or
    Flag.FIRST. The iteration ends with the session, and raises NotFound when the session is gone.
    """

    def __init__(
        self,
        connection: Connection,
        request: motion_pb2.StreamMotionRequest,
        deadline: float,
    ) -> None:
        self._connection = connection
        self._request = request
        self._deadline = deadline
        self._reader = BatchReader()
        self._batches = self._run()
        self.reconnections = 0

    @property
    def info(self) -> StreamInfo | None:
        """The header of the present connection; None before the first batch."""
        return self._reader.info

    @property
    def resume_token(self) -> str:
        """The resume token of the last batch: `Session.stream` resumes from it, in any program."""
        return self._request.resume_token

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Batch:
        return await anext(self._batches)

    async def aclose(self) -> None:
        """Ends the stream."""
        await self._batches.aclose()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.aclose()

    async def _run(self) -> AsyncGenerator[Batch]:
        backoff = Backoff(self._deadline)
        route = self._connection.route(self._request)
        while True:
            try:
                async for batch in self._once(backoff, route):
                    yield batch
                return
            except (Misdirected, Unavailable, ResourceExhausted) as error:
                if refuses(error) and self.info is None:
                    raise
                if not (goes_on(route, error) and isinstance(error, Misdirected)):
                    if not await backoff.pause(error.retry_after):
                        raise Unavailable(f"no stream for {self._deadline:g} s: {error}") from None
                    route.begin()
                self.reconnections += 1

    async def _once(self, backoff: Backoff, route: Route) -> AsyncGenerator[Batch]:
        """Batches of one connection."""
        call = self._connection.open(route, self._connection.motion.StreamMotion, self._request)
        try:
            while (message := await heard(call)) is not None:
                backoff.succeeded()
                route.answered()
                batch = read(message, self._reader)
                if batch is None:
                    continue
                if batch.resume_token:
                    self._request.resume_token = batch.resume_token
                yield batch
        finally:
            call.cancel()


def refuses(error: WayfarerError) -> bool:
    """Whether that is a first stream's answer. "Too many streams" is no answer to a later one: the
    server may not have noticed yet that the connection before is lost.
    """
    return isinstance(error, ResourceExhausted) and not error.retry_after


async def heard(call: Any) -> Any:
    """The next message of a call; None at its end. Raises WayfarerError; Unavailable on silence."""
    try:
        async with asyncio.timeout(SILENCE_S):
            message = await call.read()
    except TimeoutError:
        raise Unavailable(f"nothing heard for {SILENCE_S:g} s") from None
    except grpc.aio.AioRpcError as error:
        raise from_grpc(error) from None
    return None if message is grpc.aio.EOF else message  # type: ignore[attr-defined]


def read(message: motion_pb2.StreamMotionResponse, reader: BatchReader) -> Batch | None:
    """The batch or event of a message; None for other signs of life."""
    sent_at = message.sent_at_us / 1e6
    if message.HasField("header"):
        reader.begin(message.header, sent_at)
    elif reader.info is None:
        raise WayfarerError("the server sent motion before its header")
    elif message.HasField("batch"):
        return reader.batch(message.batch, sent_at)
    elif message.HasField("event"):
        return Batch(sent_at, (), events=(reader.event(message.event),))
    return None
