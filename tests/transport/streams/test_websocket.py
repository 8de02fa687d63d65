"""`WS /v1/stream` and `WS /v1/control`, called by a real client."""

import json
from urllib.parse import quote

import pytest
import websockets
from starlette.datastructures import QueryParams
from websockets.frames import Frame, Opcode

from tests.runtime.running import until
from tests.transport.rig import others_are_undisturbed
from wayfarer.runtime.streams.publications import SlowReader
from wayfarer.transport.streams.websocket import stream_request
from wayfarer.v1 import control_pb2, motion_pb2


async def message(socket) -> motion_pb2.StreamMotionResponse:
    return motion_pb2.StreamMotionResponse.FromString(await socket.recv())


@pytest.mark.parametrize("path", ["stream", "control"])
async def test_a_client_that_vanishes_is_cleaned_up(rig, path):
    session_id, _ = await rig.session()
    async with rig.socket(session_id) if path == "stream" else rig.control_socket() as socket:
        if path == "control":
            opening = control_pb2.ControlRequest(open={"session_id": session_id})
            await socket.send(opening.SerializeToString())
        await socket.recv()
        socket.transport.abort()
        await until(lambda: rig.service.subscriptions[0].closed)
    await others_are_undisturbed(rig, session_id)


@pytest.mark.parametrize(
    ("query", "code", "reason"),
    [
        ("none", 4404, "no session"),
        ("x" * 65, 4422, "session: has 65 characters; allowed: at most 64"),
        *((f"none&fps={fps}", 4422, "fps: must be 40, 20 or 10") for fps in ("x", "٣", "-1", "")),
        ("none&slow_reader=no", 4422, "slow_reader"),
        ("none&max_message_bytes=x", 4422, "max_message_bytes"),
        ("none&interest={", 4422, "interest"),
        ("none&interest=[]", 4422, "interest"),
        ("none&encoding=jpeg", 4422, "encoding"),
        ("none&resume_token=1", 4404, "no session"),
        ("none&colour=red", 4422, "colour: unknown; known are session, agent, "),
        ("none&encodng=smallest_three", 4422, "encodng: unknown; did you mean encoding?"),
        ('none&interest={"ring":[]}', 4422, "interest.ring: unknown; did you mean rings?"),
    ],
)
async def test_websocket_says_why_it_closes(rig, query, code, reason):
    async with rig.socket(query) as socket:
        with pytest.raises(websockets.ConnectionClosed) as caught:
            await socket.recv()
    assert caught.value.rcvd.code == code and reason in caught.value.rcvd.reason


async def test_the_query_chooses_the_format_and_resumes(rig):
    session_id, (agent, _) = await rig.session()
    query = f"&agent={agent['agent_id']}&encoding=smallest_three&profile=full&fps=20"
    async with rig.socket(session_id, query) as socket:
        header = (await message(socket)).header
        assert (header.sent_fps, header.frame_bytes) == (20, 12 + 6 * 52)
        rig.service.emit(session_id)
        batch = (await message(socket)).batch
        assert [a.alias for a in batch.added] == [agent["alias"]]
    rig.service.emit(session_id)
    resume = f"&resume_token={batch.resume_token}&slow_reader=disconnect"
    async with rig.socket(session_id, resume) as socket:
        assert (await message(socket)).header.resumed
        assert list((await message(socket)).batch.chunks.seqs) == [1, 1]
    assert rig.service.subscriptions[1].options.slow_reader is SlowReader.DISCONNECT


def test_the_query_stands_for_a_request():
    text = "session=s&agent=a&agent=b&profile=bones&bones=head&bones=neck&fps=10&slow_reader=hold"
    request = stream_request(QueryParams(text))
    assert (request.session_id, request.agent_ids) == ("s", ("a", "b"))
    assert request.format.bones == ("head", "neck") and request.format.fps == 10


async def test_websocket_is_not_compressed(rig):
    session_id, _ = await rig.session()
    async with rig.socket(session_id) as socket:
        assert "Sec-WebSocket-Extensions" not in socket.response.headers


async def test_control_from_a_browser(rig):
    session_id, (agent, _) = await rig.session()
    async with rig.control_socket() as socket:

        async def send(**payload: object) -> None:
            await socket.send(control_pb2.ControlRequest(**payload).SerializeToString())

        async def receive() -> control_pb2.ControlResponse:
            return control_pb2.ControlResponse.FromString(await socket.recv())

        await send(open={"session_id": session_id})
        assert (await receive()).motion.header.session_id == session_id
        await send(command_id=4, clear_goal={"agent_id": agent["agent_id"]})
        assert (await receive()).reply == control_pb2.CommandReply(command_id=4, revision=1)
        rig.service.emit(session_id)
        token = (await receive()).motion.batch.resume_token
        await send(ack={"resume_token": token, "playhead_us": 1_000_000})
        await until(lambda: rig.service.subscriptions[0].acks == [(1, 1.0)])
        await rig.http.delete(f"/v1/sessions/{session_id}")
        with pytest.raises(websockets.ConnectionClosedOK):
            await socket.recv()


@pytest.mark.parametrize("frame", [b"\xff\xff\xff", b"", "text"])
async def test_control_says_what_a_frame_must_be(rig, frame):
    async with rig.control_socket() as socket:
        await socket.send(frame)
        with pytest.raises(websockets.ConnectionClosed) as caught:
            await socket.recv()
    assert caught.value.rcvd.code == 4422


@pytest.mark.parametrize("parts", [[b"\xff\xfe"], [b"walk \xe2\x82", b"now"]])
async def test_a_text_that_is_not_utf_8_closes_with_1007(rig, parts):
    session_id, _ = await rig.session()
    for path in ("control", f"stream?session={session_id}"):
        async with websockets.connect(f"{rig.ws_url}/v1/{path}") as socket:
            for last, data in enumerate(parts, 1):
                kind = Opcode.TEXT if last == 1 else Opcode.CONT
                socket.protocol.send_frame(Frame(kind, data, fin=last == len(parts)))
            socket.transport.write(b"".join(socket.protocol.data_to_send()))
            with pytest.raises(websockets.ConnectionClosed) as caught:
                while True:
                    await socket.recv()
        assert caught.value.rcvd.code == 1007 and "UTF-8" in caught.value.rcvd.reason
    await until(lambda: rig.service.subscriptions[0].closed)


async def test_a_malformed_frame_ends_control_and_its_subscription(rig):
    session_id, _ = await rig.session()
    async with rig.control_socket() as socket:
        opening = control_pb2.ControlRequest(open={"session_id": session_id})
        await socket.send(opening.SerializeToString())
        await socket.recv()
        await socket.send(b"\xff\xff\xff")
        with pytest.raises(websockets.ConnectionClosed) as caught:
            await socket.recv()
    assert caught.value.rcvd.code == 4422 and "ControlRequest" in caught.value.rcvd.reason
    await until(lambda: rig.service.subscriptions[0].closed)


INTEREST = quote(
    json.dumps(
        {
            "rings": [{"radius": 10}, {"radius": 30, "format": {"encoding": "root"}}],
            "viewpoints": [{"position": {"x": 0, "y": 0, "z": 0}}],
        }
    )
)


async def test_the_query_has_rings_and_texts_move_the_viewpoints(rig):
    session_id, _ = await rig.session(agents=1)
    async with rig.socket(session_id, f"&interest={INTEREST}") as socket:
        assert len((await message(socket)).header.tiers) == 2
        rig.service.emit(session_id)
        assert (await message(socket)).batch.tier == 0
        await socket.send(b"not a text")
        for z in (500, 20):
            text = {"viewpoints": [{"position": {"x": 0, "y": 0, "z": z}}]}
            await socket.send(json.dumps(text))
        tiers = []
        while not tiers or tiers[-1] != 1:  # from the next batch on, whichever that is
            rig.service.emit(session_id)
            tiers.append((await message(socket)).batch.tier)


@pytest.mark.parametrize("text", ["{", "{}", '{"viewpoints": []}', '"' + "x" * 8_100 + '"'])
async def test_a_text_that_is_wrong_ends_the_stream(rig, text):
    session_id, _ = await rig.session(agents=1)
    async with rig.socket(session_id, f"&interest={INTEREST}") as socket:
        await message(socket)
        await socket.send(text)
        with pytest.raises(websockets.ConnectionClosed) as caught:
            while True:
                await socket.recv()
    assert caught.value.rcvd.code in (4400, 4422)


async def test_a_socket_without_rings_ignores_texts(rig):
    session_id, _ = await rig.session(agents=1)
    async with rig.socket(session_id) as socket:
        await message(socket)
        await socket.send("anything")
        rig.service.emit(session_id)
        assert (await message(socket)).HasField("batch")
