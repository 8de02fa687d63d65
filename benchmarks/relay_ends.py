"""The two ends of benchmarks/relay.py, processes of their own: a worker's stand-in and a reader.

python -m benchmarks.relay_ends worker FOLDER SIZE MESSAGES
python -m benchmarks.relay_ends grpc|websocket PORT
"""

import asyncio
import sys
from collections.abc import AsyncIterator
from typing import Any, Final

import grpc
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, unix_serve

SERVICE: Final = "wayfarer.v1.MotionService"
REQUEST: Final = b"\x0a\x0csession-0000"
"""A StreamMotionRequest with its session_id."""


async def send(folder: str, size: int, messages: int) -> None:
    """Send messages to every client for ever, as fast as it takes them."""
    data = bytes(size)

    async def stream(request: bytes, context: Any) -> AsyncIterator[bytes]:
        for _ in range(messages):
            yield data

    async def socket(connection: ServerConnection) -> None:
        for _ in range(messages):
            await connection.send(data)

    handler = grpc.unary_stream_rpc_method_handler(stream)
    server = grpc.aio.server()
    server.add_generic_rpc_handlers(
        (grpc.method_handlers_generic_handler(SERVICE, {"StreamMotion": handler}),)
    )
    server.add_insecure_port(f"unix:{folder}/grpc")
    await server.start()
    async with unix_serve(socket, f"{folder}/http", compression=None):
        await asyncio.Event().wait()


async def take(kind: str, port: int) -> int:
    """Take all messages; their number."""
    taken = 0
    if kind == "grpc":
        async with grpc.aio.insecure_channel(f"127.0.0.1:{port}") as channel:
            async for _ in channel.unary_stream(f"/{SERVICE}/StreamMotion")(REQUEST):
                taken += 1
        return taken
    url = f"ws://127.0.0.1:{port}/v1/stream?session=session-0000"
    async with connect(url, max_size=None, compression=None) as connection:
        async for _ in connection:
            taken += 1
    return taken


if __name__ == "__main__":
    if sys.argv[1] == "worker":
        asyncio.run(send(sys.argv[2], int(sys.argv[3]), int(sys.argv[4])))
    else:
        print(asyncio.run(take(sys.argv[1], int(sys.argv[2]))))
