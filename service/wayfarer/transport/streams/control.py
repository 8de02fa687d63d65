"""Goals and motion over one connection, with acknowledgements: Control and `WS /v1/control`."""

from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing
from typing import Final

import structlog

from wayfarer.errors import InvalidArgument
from wayfarer.transport import errors, schema
from wayfarer.transport.contract import CALLS
from wayfarer.transport.conversion import wire
from wayfarer.transport.edge.call_rates import count_call
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.streams.framing import field
from wayfarer.transport.streams.merge import merged
from wayfarer.transport.streams.stream import MotionStream
from wayfarer.v1 import common_pb2, control_pb2

log = structlog.get_logger(__name__)

OPEN_TIMEOUT_S: Final = 10.0
SILENT: Final = ("ack", "viewpoints")
"""Commands that are answered only if they are refused."""

COMMANDS: Final = {
    field.name: call
    for call in CALLS.values()
    for field in control_pb2.ControlRequest.DESCRIPTOR.fields
    if field.message_type is call.request.DESCRIPTOR and field.name != "open"
}
"""The RPC of each payload that is a command."""

Requests = AsyncIterator[control_pb2.ControlRequest]


async def control(gateway: Gateway, requests: Requests) -> AsyncGenerator[bytes]:
    """Yields the messages of a stream and the replies to commands, each an encoded ControlResponse.
    Close it with `aclose`.

    One request is read at a time, and the next one after its reply has been taken: a flood of
    commands slows itself down and is never stored. The stream continues after the last request.
    Raises what `MotionApi.stream` raises, and whatever `requests` raises.
    """
    opening = await _opening(requests)
    async with (
        gateway.motion.follow(opening) as (stream, messages),
        aclosing(_replies(requests, stream, gateway)) as replies,
        aclosing(merged(messages, replies)) as both,
    ):
        async for item in both:
            if isinstance(item, control_pb2.CommandReply):
                yield control_pb2.ControlResponse(reply=item).SerializeToString()
            else:
                yield b"".join(field(control_pb2.ControlResponse.MOTION_FIELD_NUMBER, [item]))


async def _opening(requests: Requests) -> schema.StreamRequest:
    """Returns the request in the first message. Raises InvalidArgument."""
    hint = "the first message must be `open`, with a session_id"
    opening = await wire.first(requests, "open", OPEN_TIMEOUT_S, hint)
    return wire.parse(schema.StreamRequest, opening, "open")


async def _replies(
    requests: Requests, stream: MotionStream, gateway: Gateway
) -> AsyncGenerator[control_pb2.CommandReply]:
    """Yields a reply to each command, in order; to a `SILENT` one only if it is refused."""
    async for request in requests:
        reply = control_pb2.CommandReply(command_id=request.command_id)
        try:
            if request.WhichOneof("payload") == "ack":
                stream.ack(request.ack.resume_token, request.ack.playhead_us / 1e6)
                continue
            count_call()
            if request.WhichOneof("payload") == "viewpoints":
                stream.look(wire.parse(schema.Viewpoints, request.viewpoints))
                continue
            reply.revision = await _give(request, gateway)
        except Exception as error:
            errors.log_unexpected(log, error, "Control")
            reply.problem.CopyFrom(_problem(error))
        yield reply


async def _give(request: control_pb2.ControlRequest, gateway: Gateway) -> int:
    """Carries out a command; returns the new revision."""
    payload = request.WhichOneof("payload")
    if payload not in COMMANDS:
        raise InvalidArgument(
            f"after `open` comes one of {', '.join((*SILENT, *COMMANDS))}", payload or "payload"
        )
    call = COMMANDS[payload]
    given = await wire.from_message(call, gateway.calls[call.name])(getattr(request, payload))
    return int(given.revision)


def _problem(error: Exception) -> common_pb2.Problem:
    violations = errors.violations_of(error)
    return common_pb2.Problem(
        code=errors.code_of(error).grpc.value[0],
        message=errors.message_of(error),
        field=violations[0][0] if violations else "",
        nearest=errors.nearest_of(error) or None,
    )
