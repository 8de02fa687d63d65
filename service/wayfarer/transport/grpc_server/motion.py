"""MotionService and ControlService over the gateway.

A cancelled call closes the generator, and so the subscription; CancelledError is never swallowed,
since grpc.aio leaks such calls (grpc/grpc#43360).
"""

from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing

import grpc
from grpc.aio import ServicerContext as Context

from wayfarer.transport import schema, wire
from wayfarer.transport.control import control as controlled
from wayfarer.transport.gateway import Gateway
from wayfarer.v1 import control_pb2, motion_pb2


class MotionService:
    """See motion.proto."""

    def __init__(self, gateway: Gateway) -> None:
        self._motion = gateway.motion

    async def StreamMotion(  # noqa: N802
        self, request: motion_pb2.StreamMotionRequest, context: Context
    ) -> AsyncGenerator[bytes]:
        """Follow the agents of a session."""
        stream = self._motion.stream(wire.parse(schema.StreamWish, request))
        async with aclosing(stream) as messages:
            async for message in messages:
                yield message

    async def GenerateClip(  # noqa: N802
        self, request: motion_pb2.GenerateClipRequest, context: Context
    ) -> AsyncGenerator[motion_pb2.GenerateClipResponse]:
        """Make a clip."""
        clip = self._motion.generate_clip(wire.parse(schema.ClipWish, request))
        async with aclosing(clip) as messages:
            async for message in messages:
                yield message

    async def StepAgents(  # noqa: N802
        self, request: motion_pb2.StepAgentsRequest, context: Context
    ) -> motion_pb2.StepAgentsResponse:
        """Let time pass in a lock-step session."""
        wish = wire.parse(schema.StepWish, request)
        return await self._motion.step(request.session_id, wish)


class ControlService:
    """See control.proto."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway

    async def Control(  # noqa: N802
        self, request_iterator: AsyncIterator[control_pb2.ControlRequest], context: Context
    ) -> AsyncGenerator[bytes]:
        """Goals and motion over one connection."""
        async with aclosing(controlled(self._gateway, request_iterator)) as messages:
            async for message in messages:
                yield message


def add_motion_services(gateway: Gateway, server: grpc.aio.Server) -> None:
    """As generated code would, but that the messages of streams are encoded when they come here."""
    motion, control = MotionService(gateway), ControlService(gateway)
    services = {
        "MotionService": {
            "StreamMotion": grpc.unary_stream_rpc_method_handler(
                motion.StreamMotion, motion_pb2.StreamMotionRequest.FromString
            ),
            "GenerateClip": grpc.unary_stream_rpc_method_handler(
                motion.GenerateClip,
                motion_pb2.GenerateClipRequest.FromString,
                motion_pb2.GenerateClipResponse.SerializeToString,
            ),
            "StepAgents": grpc.unary_unary_rpc_method_handler(
                motion.StepAgents,
                motion_pb2.StepAgentsRequest.FromString,
                motion_pb2.StepAgentsResponse.SerializeToString,
            ),
        },
        "ControlService": {
            "Control": grpc.stream_stream_rpc_method_handler(
                control.Control, control_pb2.ControlRequest.FromString
            ),
        },
    }
    package = motion_pb2.DESCRIPTOR.package
    server.add_generic_rpc_handlers(
        [
            grpc.method_handlers_generic_handler(f"{package}.{name}", methods)
            for name, methods in services.items()
        ]
    )
