"""The few calls that a simulated client makes: plain stubs, so that the generator stays cheap."""

import asyncio
import time
from collections.abc import AsyncIterator, Iterable
from dataclasses import replace
from typing import Any, cast
from urllib.parse import quote

import grpc
import websockets
from google.rpc import code_pb2
from google.rpc.error_details_pb2 import ErrorInfo
from google.rpc.status_pb2 import Status

from wayfarer.v1 import (
    agent_pb2_grpc,
    control_pb2,
    control_pb2_grpc,
    goal_pb2_grpc,
    motion_pb2,
    motion_pb2_grpc,
    session_pb2_grpc,
)
from wayfarer_lab.load.rings import WalkingViewpoint
from wayfarer_lab.load.tally import Latencies
from wayfarer_lab.load.target import Target

MESSAGE_BYTES = 64 << 20


class StreamError(Exception):
    """The server or the network ended the stream; the text says how."""


class Connection:
    """A separate gRPC channel, as a client on another machine would have."""

    def __init__(self, target: Target) -> None:
        self.metadata = target.metadata
        self._target = target
        self._channel = grpc.aio.insecure_channel(
            target.grpc,
            options=[
                ("grpc.use_local_subchannel_pool", 1),  # else all channels share a connection
                ("grpc.max_receive_message_length", MESSAGE_BYTES),
            ],
        )
        self.sessions = session_pb2_grpc.SessionServiceStub(self._channel)
        self.agents = agent_pb2_grpc.AgentServiceStub(self._channel)
        self.goals = goal_pb2_grpc.GoalServiceStub(self._channel)
        self._control = control_pb2_grpc.ControlServiceStub(self._channel)
        self._motion = motion_pb2_grpc.MotionServiceStub(self._channel)

    async def close(self) -> None:
        """Ends all calls."""
        await self._channel.close(None)

    async def stream(
        self, session_id: str, transport: str, viewpoint: WalkingViewpoint | None = None
    ) -> AsyncIterator[motion_pb2.StreamMotionResponse]:
        """The messages of a stream over "grpc" or "websocket"; with a viewpoint
        over Control, which moves it. Raises StreamError, in any case.
        """
        read = self._calls if transport == "grpc" else self._frames
        try:
            async for message in read(session_id, viewpoint):
                yield message
        except grpc.aio.AioRpcError as error:
            raise StreamError(error.code().name) from error
        except websockets.ConnectionClosed as error:
            raise StreamError(str(error.rcvd or "cut off")) from error
        except (websockets.WebSocketException, OSError) as error:
            raise StreamError(type(error).__name__) from error
        raise StreamError("OK")

    async def _calls(
        self, session_id: str, viewpoint: WalkingViewpoint | None
    ) -> AsyncIterator[motion_pb2.StreamMotionResponse]:
        if viewpoint is None:
            request = motion_pb2.StreamMotionRequest(session_id=session_id)
            async for message in self._motion.StreamMotion(request, metadata=self.metadata):
                yield message
            return
        requests = viewpoint.requests(session_id)
        async for response in self._control.Control(requests, metadata=self.metadata):
            if message := _motion(response, viewpoint):
                yield message

    async def _frames(
        self, session_id: str, viewpoint: WalkingViewpoint | None
    ) -> AsyncIterator[motion_pb2.StreamMotionResponse]:
        path = "control" if viewpoint else f"stream?session={quote(session_id)}"
        async with websockets.connect(
            f"{self._target.http.replace('http', 'ws', 1)}/v1/{path}",
            additional_headers=dict(self.metadata),
            compression=None,
            max_size=MESSAGE_BYTES,
        ) as socket:
            if viewpoint is None:
                async for frame in socket:
                    if isinstance(frame, bytes):
                        yield motion_pb2.StreamMotionResponse.FromString(frame)
                return
            asking = asyncio.create_task(_ask(socket, viewpoint, session_id))
            try:
                async for frame in socket:
                    response = control_pb2.ControlResponse.FromString(cast("bytes", frame))
                    if message := _motion(response, viewpoint):
                        yield message
            finally:
                asking.cancel()
                await asyncio.gather(asking, return_exceptions=True)


async def _ask(
    socket: websockets.ClientConnection, viewpoint: WalkingViewpoint, session_id: str
) -> None:
    async for request in viewpoint.requests(session_id):
        await socket.send(request.SerializeToString())


def _motion(
    response: control_pb2.ControlResponse, viewpoint: WalkingViewpoint
) -> motion_pb2.StreamMotionResponse | None:
    """The motion in a message over Control; a viewpoint is answered only if it is refused."""
    if response.HasField("motion"):
        return response.motion
    code = code_pb2.Code.Name(response.reply.problem.code)
    viewpoint.refused(f"VIEWPOINTS_{code}")
    return None


def node_of(error: grpc.aio.AioRpcError, target: Target) -> Target | None:
    """The node that a misdirected call names; None: the call was not misdirected."""
    info, trailers = ErrorInfo(), cast("Iterable[tuple[str, Any]]", error.trailing_metadata() or ())
    metadata = dict(trailers)
    for detail in Status.FromString(metadata.get("grpc-status-details-bin", b"")).details:
        if detail.Unpack(info) and info.reason == "MISDIRECTED":
            node = info.metadata
            host = node["host"] or target.grpc.rpartition(":")[0]
            scheme = target.http.partition(":")[0]
            http = f"{scheme}://{host}:{node['http_port']}"
            return replace(target, grpc=f"{host}:{node['grpc_port']}", http=http)
    return None


async def followed(
    connection: Connection,
    session_id: str,
    transport: str,
    first_chunk: Latencies,
    viewpoint: WalkingViewpoint | None = None,
) -> AsyncIterator[motion_pb2.StreamMotionResponse]:
    """A stream's messages; how long the first poses took is counted. Raises StreamError."""
    began, waits = time.monotonic(), True
    async for message in connection.stream(session_id, transport, viewpoint):
        if waits and message.HasField("batch"):
            first_chunk.add(time.monotonic() - began)
            waits = False
        yield message
