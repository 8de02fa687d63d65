"""Control of the Python client."""

import asyncio

import grpc
import pytest

import wayfarer_client as wf
from tests.clients.fake_server import ASKED, FOREVER, Refusal
from tests.clients.replies import GONE, HEADER, batch, moved, replied, resumed
from wayfarer_client.v1 import common_pb2, motion_pb2


async def test_control(server, client):
    session = await client.create_session()
    problem = common_pb2.Problem(code=10, message="revision 7, not 3", field="expected_revision")
    server.scripts["Control"] = [
        [
            *(ASKED, moved(HEADER), ASKED, replied(revision=8), moved(batch("t0", 3)), ASKED),
            *(ASKED, replied(problem=problem), FOREVER),
        ]
    ]
    async with session.control(format=wf.PoseFormat(fps=10)) as control:
        assert await control.set_goal("a-1", (1, 0, 2)) == 8
        found = await anext(control)
        assert found.frames[0].seq == 3 and control.info.session_id == "s"
        with pytest.raises(wf.Aborted, match="revision 7, not 3") as caught:
            await control.clear_goal("a-1", expected=3)
        assert caught.value.field == "expected_revision"
    opened, goal, ack, clear = server.asked("Control")
    assert (opened.open.session_id, opened.open.format.fps) == ("s", 10)
    assert (goal.set_goal.agent_id, goal.set_goal.goal.position.z) == ("a-1", 2)
    assert (ack.ack.resume_token, ack.ack.playhead_us) == ("t0", 600_000)
    assert clear.clear_goal.expected_revision == 3
    assert goal.command_id != clear.command_id


async def test_the_playhead_goes_on_while_nothing_moves(server, client):
    session = await client.create_session()
    beat = motion_pb2.StreamMotionResponse(sent_at_us=7_000_000, heartbeat=motion_pb2.Heartbeat())
    server.scripts["Control"] = [
        [ASKED, moved(HEADER), moved(batch("t0")), ASKED, moved(beat), ASKED]
    ]
    async with session.control() as control:
        assert len([found async for found in control]) == 1
    _, *acks = (request.ack for request in server.asked("Control"))
    assert [ack.playhead_us for ack in acks] == [0, 7_000_000]
    assert {ack.resume_token for ack in acks} == {"t0"}


async def test_control_comes_back_and_commands_under_way_fail(server, client):
    session = await client.create_session()
    server.scripts["Control"] = [
        [ASKED, moved(HEADER), moved(batch("t0")), ASKED, GONE],
        # to the last ack: to write on a call that has ended makes an error of its end (grpc.aio)
        [ASKED, moved(resumed()), ASKED, replied(revision=2), moved(batch("t1")), ASKED, ASKED],
    ]
    async with session.control() as control:
        while not control.resume_token:
            await asyncio.sleep(0.01)
        with pytest.raises(wf.Unavailable, match="the connection was lost"):
            await control.set_goal("a-1", (1, 0, 2))
        assert await control.set_goal("a-1", (1, 0, 2)) == 2
        assert [(await anext(control)).resume_token for _ in range(2)] == ["t0", "t1"]
        assert control.reconnections == 1
        with pytest.raises(StopAsyncIteration):
            await anext(control)
        with pytest.raises(wf.Unavailable, match="the control stream has ended"):
            await control.set_goal("a-1", (1, 0, 2))
    assert server.asked("Control")[2].open.resume_token == "t0"


async def test_an_open_that_is_refused_ends_control(server, client):
    session = await client.create_session()
    server.scripts["Control"] = [[ASKED, Refusal(grpc.StatusCode.NOT_FOUND, "no session 's'")]]
    async with session.control() as control:
        with pytest.raises(wf.NotFound, match="no session"):
            await control.set_goal("a", (0, 0, 0))
        with pytest.raises(wf.NotFound, match="no session"):
            await anext(control)
