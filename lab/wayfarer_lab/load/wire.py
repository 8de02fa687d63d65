"""The few calls that a simulated client makes: plain stubs, so that the generator stays cheap."""

import json
import time
from collections.abc import AsyncIterator, Iterable
from dataclasses import replace
from typing import Any, cast
from urllib.parse import quote

import grpc
import websockets
from google.rpc.error_details_pb2 import ErrorInfo
from google.rpc.status_pb2 import Status

from wayfarer.v1 import (
    agent_pb2_grpc,
    goal_pb2_grpc,
    motion_pb2,
    motion_pb2_grpc,
    session_pb2_grpc,
)
from wayfarer_lab.load.tally import Latencies
from wayfarer_lab.load.target import Target

MESSAGE_BYTES = 64 << 20


class StreamError(Exception):
    """By the server or the network; says how."""


class Connection:
    """A gRPC channel of its own, as a client on its own machine would have."""

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
        self._motion = motion_pb2_grpc.MotionServiceStub(self._channel)

    async def close(self) -> None:
        """End all calls."""
        await self._channel.close(None)

    async def stream(
        self, session_id: str, transport: str, interest: motion_pb2.Interest | None = None
    ) -> AsyncIterator[motion_pb2.StreamMotionResponse]:
        """The messages of a stream over "grpc" or "websocket". Raises StreamError, in any case."""
        read = self._calls if transport == "grpc" else self._frames
        messages = read(session_id, interest)
        try:
            async for message in messages:
                yield message
        except grpc.aio.AioRpcError as error:
            raise StreamError(error.code().name) from error
        except websockets.ConnectionClosed as error:
            raise StreamError(str(error.rcvd or "cut off")) from error
        except (websockets.WebSocketException, OSError) as error:
            raise StreamError(type(error).__name__) from error
        raise StreamError("OK")

    def _calls(
        self, session_id: str, interest: motion_pb2.Interest | None
    ) -> AsyncIterator[motion_pb2.StreamMotionResponse]:
        request = motion_pb2.StreamMotionRequest(session_id=session_id, interest=interest)
        messages: AsyncIterator[motion_pb2.StreamMotionResponse] = self._motion.StreamMotion(
            request, metadata=self.metadata
        )
        return messages

    async def _frames(
        self, session_id: str, interest: motion_pb2.Interest | None
    ) -> AsyncIterator[motion_pb2.StreamMotionResponse]:
        url = f"{self._target.http.replace('http', 'ws', 1)}/v1/stream?session={quote(session_id)}"
        if interest is not None:
            url += f"&interest={quote(json.dumps(_document(interest)))}"
        async with websockets.connect(
            url,
            additional_headers=dict(self.metadata),
            compression=None,
            max_size=MESSAGE_BYTES,
        ) as socket:
            async for frame in socket:
                if isinstance(frame, bytes):
                    yield motion_pb2.StreamMotionResponse.FromString(frame)


def _document(interest: motion_pb2.Interest) -> dict[str, Any]:
    """As the query of a WebSocket has it; the viewpoint is the origin."""
    formats = [
        {"encoding": "root"}
        if ring.format.encoding == motion_pb2.POSE_ENCODING_ROOT
        else {"fps": ring.format.fps or 40}
        for ring in interest.rings
    ]
    return {
        "rings": [
            {"radius": ring.radius, "format": each}
            for ring, each in zip(interest.rings, formats, strict=True)
        ],
        "viewpoints": [{"position": {"x": 0, "y": 0, "z": 0}}],
    }


def node_of(error: grpc.aio.AioRpcError, target: Target) -> Target | None:
    """The node that a misdirected call names; None: the call was not misdirected."""
    info, told = ErrorInfo(), cast("Iterable[tuple[str, Any]]", error.trailing_metadata() or ())
    metadata = dict(told)
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
    interest: motion_pb2.Interest | None = None,
) -> AsyncIterator[motion_pb2.StreamMotionResponse]:
    """A stream's messages; how long the first poses took is counted. Raises StreamError."""
    began, waits = time.monotonic(), True
    async for message in connection.stream(session_id, transport, interest):
        if waits and message.HasField("batch"):
            first_chunk.add(time.monotonic() - began)
            waits = False
        yield message
