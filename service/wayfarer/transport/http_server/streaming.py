"""Answers that are sent piece by piece."""

import asyncio
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from typing import Final, TypeVar

import structlog
from google.protobuf.message import Message as ProtoMessage
from starlette.responses import StreamingResponse
from starlette.types import Message, Send

from wayfarer.transport import errors, schema
from wayfarer.transport.conversion import wire

log = structlog.get_logger(__name__)

STALL_S: Final = 30.0
"""Seconds after which a reader that accepts nothing is disconnected."""

Item = TypeVar("Item")


class Pieces(StreamingResponse):
    """Disconnects a reader that stalls; nothing is stored for it beyond the socket's buffer."""

    async def stream_response(self, send: Send) -> None:
        """Like StreamingResponse."""

        async def timed(message: Message) -> None:
            async with asyncio.timeout(STALL_S):
                await send(message)

        try:
            await super().stream_response(timed)
        except TimeoutError:
            log.info("reader stalled", after_s=STALL_S)


class Lines(Pieces):
    """JSON documents, one per line."""

    media_type = "application/x-ndjson"


class ServerSentEvents(Pieces):
    """See the HTML standard, 9.2."""

    media_type = "text/event-stream"


async def begun(
    items: AsyncGenerator[Item], write: Callable[[Item], str], wrong: Callable[[Exception], str]
) -> AsyncGenerator[str]:
    """The text of `items`. An error of the first item is raised here, before the answer begins; an
    error of a later one becomes the text that `wrong` makes of it.
    """
    try:
        first = [await anext(items)]
    except StopAsyncIteration:
        first = []

    async def texts() -> AsyncGenerator[str]:
        async with aclosing(items):
            for item in first:
                yield write(item)
            try:
                async for item in items:
                    yield write(item)
            except Exception as error:
                errors.log_unexpected(log, error, "stream")
                yield wrong(error)

    return texts()


async def clip_lines(messages: AsyncGenerator[ProtoMessage]) -> Lines:
    """A clip or replay: one ClipLine after the other."""
    return Lines(await begun(messages, _line, _problem_line))


def _line(message: ProtoMessage) -> str:
    return _written(schema.ClipLine.model_validate(wire.values(message)))


def _problem_line(error: Exception) -> str:
    problem = schema.Problem.model_validate(errors.to_problem(error))
    return _written(schema.ClipLine(problem=problem))


def _written(line: schema.ClipLine) -> str:
    return line.model_dump_json(include={line.given[0]}) + "\n"
