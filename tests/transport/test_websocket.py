"""The stream over WebSocket."""

import pytest
import websockets

from tests.transport.rig import others_are_undisturbed, until
from wayfarer.transport.websocket import is_allowed_origin


async def test_a_websocket_client_that_vanishes_is_cleaned_up(rig):
    session_id, _ = await rig.session()
    async with rig.socket(session_id) as socket:
        await socket.recv()
        socket.transport.abort()
        await until(lambda: rig.service.subscriptions[0].closed)
    await others_are_undisturbed(rig, session_id)


@pytest.mark.parametrize(
    ("query", "code", "reason"),
    [("none", 4404, "no session"), ("x" * 65, 1008, "")],
)
async def test_websocket_says_why_it_closes(rig, query, code, reason):
    with pytest.raises((websockets.ConnectionClosed, websockets.InvalidStatus)) as caught:
        async with rig.socket(query) as socket:
            await socket.recv()
    if isinstance(caught.value, websockets.ConnectionClosed):
        assert caught.value.rcvd.code == code and reason in caught.value.rcvd.reason
    else:  # refused at the handshake
        assert caught.value.response.status_code == 403


async def test_websocket_of_a_foreign_page_is_refused(rig):
    session_id, _ = await rig.session()
    with pytest.raises(websockets.InvalidStatus) as caught:
        async with rig.socket(session_id, origin="https://evil.example"):
            pass
    assert caught.value.response.status_code == 403
    async with rig.socket(session_id, origin="http://localhost:3000") as socket:
        await socket.recv()


@pytest.mark.parametrize(
    ("origin", "host", "allowed"),
    [
        (None, "motion.example:8080", True),
        ("https://motion.example:8080", "motion.example:8080", True),
        ("http://localhost:5173", "motion.example:8080", True),
        ("http://127.0.0.1", "motion.example:8080", True),
        ("http://[::1]:9", "motion.example:8080", True),
        ("https://evil.example", "motion.example:8080", False),
        ("https://localhost.evil.example", "127.0.0.1:8080", False),
        ("null", "127.0.0.1:8080", False),
        ("http://[", "127.0.0.1:8080", False),
    ],
)
def test_origins(origin, host, allowed):
    assert is_allowed_origin(origin, host) == allowed


async def test_websocket_is_not_compressed(rig):
    session_id, _ = await rig.session()
    async with rig.socket(session_id) as socket:
        assert "Sec-WebSocket-Extensions" not in socket.response.headers
