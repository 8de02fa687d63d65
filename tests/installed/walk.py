"""Makes one agent walk on a running server, and checks the data of both of its streams.

    python walk.py http://127.0.0.1:8080 127.0.0.1:50051

Needs `wayfarer-client` and `websockets`, and nothing else of this repository. Exit code 1 and a
sentence when something is not as it should be.
"""

import asyncio
import re
import sys
import urllib.request
from collections.abc import AsyncIterator
from itertools import pairwise

import numpy as np
import websockets

from wayfarer_client import AgentSpec, Client, Frames, Session
from wayfarer_client.stream import read
from wayfarer_client.v1 import motion_pb2
from wayfarer_client.wire import BatchReader

GOAL = (0.0, 0.0, 2.5)  # metres; glTF's axes, Y up: straight ahead of an agent at the origin
NEAR_M = 0.5
LIMIT_S = 60.0


async def over_grpc(session: Session) -> AsyncIterator[Frames]:
    """Chunks as the Python client delivers them."""
    async for batch in session.stream():
        for frames in batch:
            yield frames


async def over_websocket(http: str, session: Session) -> AsyncIterator[Frames]:
    """Chunks of the same session from the WebSocket: its binary messages are the same protobuf."""
    reader = BatchReader()
    address = http.replace("http", "ws", 1) + f"/v1/stream?session={session.session_id}"
    async with websockets.connect(address) as socket:
        async for message in socket:
            assert isinstance(message, bytes), f"a text message came: {message[:200]!r}"
            batch = read(motion_pb2.StreamMotionResponse.FromString(message), reader)
            for frames in batch or ():
                yield frames


async def follow(chunks: AsyncIterator[Frames]) -> list[Frames]:
    """All chunks until the agent stands at its goal."""
    found: list[Frames] = []
    async for frames in chunks:
        found.append(frames)
        if frames.state == "standing" and to_goal(frames.translation[-1]) < NEAR_M:
            return found
    raise AssertionError(f"the stream ended after {len(found)} chunks, before the goal was reached")


def to_goal(hips: np.ndarray) -> float:
    """Horizontal metres from hips to the goal."""
    return float(np.hypot(hips[0] - GOAL[0], hips[2] - GOAL[2]))


def check(found: list[Frames]) -> str:
    """Describes whole frames of a body that walks; otherwise raises AssertionError."""
    hips = np.concatenate([frames.translation for frames in found])
    rotations = np.concatenate([frames.rotations for frames in found])
    assert rotations.shape[1:] == (22, 4), f"rotations are {rotations.shape}, not [F, 22, 4]"
    assert np.isfinite(hips).all() and np.isfinite(rotations).all(), "some numbers are not finite"
    off = np.abs(np.linalg.norm(rotations, axis=-1) - 1).max()
    assert off < 1e-3, f"the length of a quaternion is off by {off:.3g}"
    for last, following in pairwise(found):
        expected = (last.seq + 1, last.first_frame + len(last.translation))
        assert (following.seq, following.first_frame) == expected, f"frames are missing: {expected}"
    way = float(np.hypot(*(hips[-1] - hips[0])[[0, 2]]))
    steps = np.linalg.norm(np.diff(hips, axis=0), axis=-1)
    assert way > 1.5, f"the agent moved by {way:.2f} m only"
    assert steps.max() < 0.1, f"the agent jumped by {steps.max():.2f} m from one frame to the next"
    assert (hips[:, 1] > 0.6).all(), f"the hips came down to {hips[:, 1].min():.2f} m"
    legs = rotations[:, 1:9]  # thighs, shins, feet, …: a body that slides would not move them
    assert np.ptp(legs, axis=0).max() > 0.2, "the legs did not move"
    assert any(frames.state == "walking" for frames in found), "no chunk says that it walks"
    return f"{len(hips)} frames, {way:.1f} m"


def check_page(http: str) -> None:
    """Raises AssertionError, HTTPError unless the viewer's page and all its modules are there."""
    with urllib.request.urlopen(http, timeout=10) as page:
        html = page.read().decode()
    assert "<html" in html, "the viewer's page is missing"
    modules = re.findall(r'rel="modulepreload" href="([^"]+)"', html)
    assert any("/client/" in module for module in modules), f"no module of the client in {modules}"
    for module in modules:
        with urllib.request.urlopen(f"{http}/{module}", timeout=10) as script:
            assert script.read(), f"{module} is empty"


async def walk(http: str, grpc: str) -> str:
    """Describes the data of both streams. Raises AssertionError, TimeoutError, WayfarerError."""
    check_page(http)
    async with (
        asyncio.timeout(LIMIT_S),
        Client(grpc) as client,
        await client.create_session() as session,
    ):
        (agent,) = await session.create_agents(AgentSpec(seed=1))
        chunks = over_grpc(session), over_websocket(http, session)
        streams = [asyncio.create_task(follow(stream)) for stream in chunks]
        await session.set_goal(agent, GOAL)
        both = [check(found) for found in await asyncio.gather(*streams)]
    return f"gRPC {both[0]}; WebSocket {both[1]}"


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    try:
        print(asyncio.run(walk(sys.argv[1], sys.argv[2])))
    except Exception as error:
        sys.exit(f"{type(error).__name__}: {error}")
