"""Control of the Python client."""

import asyncio
import json
from pathlib import Path

import grpc
import pytest

import wayfarer_client as wf
from tests.clients.fake_server import ASKED, FOREVER, Refusal
from tests.clients.replies import GONE, HEADER, batch, moved, replied, resumed
from wayfarer_client.v1 import common_pb2, control_pb2, motion_pb2


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
        # to the last ack: a write on an ended call turns its end into an error (grpc.aio)
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


INTEREST = wf.Interest(
    rings=[wf.Ring(10), wf.Ring(100, wf.PoseFormat(encoding="root"))],
    viewpoints=[wf.Viewpoint((0, 1.7, 0))],
)


async def test_viewpoints_move_and_the_next_connection_begins_with_them(server, client):
    session = await client.create_session()
    problem = common_pb2.Problem(code=8, message="100 calls a second at most")
    reply = control_pb2.CommandReply(command_id=(1 << 64) - 1, problem=problem)
    refused = control_pb2.ControlResponse(reply=reply)
    server.scripts["Control"] = [
        [ASKED, moved(HEADER), moved(batch("t0")), ASKED, ASKED, refused, GONE],
        [ASKED, moved(resumed()), moved(batch("t1")), FOREVER],
    ]
    async with session.control(interest=INTEREST, max_message_bytes=60_000) as control:
        await control.look(wf.Viewpoint((1, 0, 0)), wf.Viewpoint((2, 0, 0), reach=4))
        found = [(await anext(control)).resume_token for _ in range(2)]
        assert found == ["t0", "t1"]
        with pytest.raises(wf.ResourceExhausted, match="100 calls"):
            await control.look(wf.Viewpoint((3, 0, 0)))
    opened, *_ = asked = server.asked("Control")
    assert [ring.radius for ring in opened.open.interest.rings] == [10, 100]
    assert opened.open.interest.rings[1].format.encoding == motion_pb2.POSE_ENCODING_ROOT
    assert opened.open.max_message_bytes == 60_000
    views = [request.viewpoints for request in asked if request.HasField("viewpoints")]
    assert [view.position.x for view in views[0].viewpoints] == [1, 2]
    again = [request.open for request in asked if request.HasField("open")][-1]
    assert [view.reach for view in again.interest.viewpoints] == [1, 4]


async def test_a_stream_without_rings_has_no_viewpoints(server, client):
    session = await client.create_session()
    server.scripts["Control"] = [[ASKED, moved(HEADER), FOREVER]]
    async with session.control() as control:
        with pytest.raises(wf.FailedPrecondition, match="without `interest`"):
            await control.look(wf.Viewpoint((1, 0, 0)))


async def test_poses_of_all_tiers_have_the_bones_of_the_first(server, client):
    session = await client.create_session()
    told = golden("header_tiers"), golden("batch_root")
    server.scripts["Control"] = [[ASKED, *map(moved, told), FOREVER]]
    async with session.control(interest=INTEREST) as control:
        found = await anext(control)
    [frames] = found
    assert (found.tier, frames.rotations.shape) == (2, (2, 2, 4))
    assert frames.translation[1].tolist() == [1.0, 1.5, 1.25]
    assert frames.times[1] - frames.times[0] == pytest.approx(0.1)


async def test_who_comes_nearer_goes_on_and_who_was_not_introduced_is_not_there(server, client):
    session = await client.create_session()
    names = ("header_tiers", "batch_closer", "batch_root", "batch_closer")
    hiding = motion_pb2.StreamMotionResponse(batch=motion_pb2.MotionBatch(hidden=[300]))
    told = [*map(golden, names), hiding, golden("batch_closer")]
    server.scripts["Control"] = [[ASKED, *map(moved, told), FOREVER]]
    async with session.control(interest=INTEREST) as control:
        unknown, root, closer, hidden, late = [await anext(control) for _ in range(5)]
    assert not unknown.frames and not late.frames
    [before], [after] = root, closer
    assert root.added == hidden.hidden == (before.agent,)
    assert not closer.added and closer.tier == 1 and after.agent is before.agent
    assert after.seq == before.seq + 1 and not after.flags
    assert after.times[0] == pytest.approx(before.times[-1] + 0.1)


def golden(name: str) -> motion_pb2.StreamMotionResponse:
    path = Path(__file__).parents[1] / "golden" / "messages.json"
    return motion_pb2.StreamMotionResponse.FromString(
        bytes.fromhex(json.loads(path.read_text())[name])
    )


async def test_what_is_said_at_the_same_time_is_all_said(server, client):
    """A call of grpc.aio ends when it is written to twice at once."""
    session = await client.create_session()
    server.scripts["Control"] = [[ASKED, moved(HEADER), moved(batch("t0")), *[ASKED] * 51]]
    async with session.control() as control:
        await anext(control)
        await asyncio.gather(*(control.ack(number) for number in range(1, 51)))
        assert [found async for found in control] == [], "the server ends when it has read all"
    _, *acks = server.asked("Control")
    assert sorted(said.ack.playhead_us for said in acks)[1:] == [
        1_000_000 * n for n in range(1, 51)
    ]
