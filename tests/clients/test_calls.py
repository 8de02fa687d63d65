"""Calls of the Python client: requests, replies and refusals."""

import asyncio
import math
import threading

import grpc
import numpy as np
import pytest
from google.protobuf.duration_pb2 import Duration
from google.rpc.error_details_pb2 import BadRequest, RetryInfo

import wayfarer_client as wf
from tests.clients.fake_server import FakeServer, Refusal
from tests.clients.replies import GONE, HEADER, batch, new_session, resumed
from tests.golden import messages
from wayfarer_client.v1 import (
    admin_pb2,
    agent_pb2,
    catalog_pb2,
    common_pb2,
    motion_pb2,
    session_pb2,
    snapshot_pb2,
)


async def test_refusals_say_which_field_and_when_to_come_back(server, client):
    session = await client.create_session()
    violation = BadRequest.FieldViolation(field="goals[3].speed", description="too fast")
    refusals = [
        Refusal(
            grpc.StatusCode.INVALID_ARGUMENT,
            "goals[3].speed: too fast",
            (BadRequest(field_violations=[violation]),),
        ),
        Refusal(
            grpc.StatusCode.RESOURCE_EXHAUSTED,
            "no time for 64 agents",
            (RetryInfo(retry_delay=Duration(seconds=60, nanos=500_000_000)),),
        ),
        Refusal(grpc.StatusCode.ABORTED, "revision 4, not 3"),
    ]

    def refuse(_):
        raise refusals.pop(0)

    server.answers["SetPath"] = server.answers["CreateAgents"] = refuse
    with pytest.raises(wf.InvalidArgument) as invalid:
        await session.set_path("a", [])
    assert invalid.value.field == "goals[3].speed"
    with pytest.raises(wf.ResourceExhausted) as full:
        await session.create_agents(wf.AgentSpec())
    assert full.value.retry_after == 60.5
    with pytest.raises(wf.Aborted, match="revision 4"):
        await session.set_path("a", [], expected=3)
    assert server.asked("SetPath")[1].expected_revision == 3


async def test_what_is_absent_from_an_update_is_not_sent(server, client):
    session = await client.create_session()
    changed = agent_pb2.Agent(agent_id="a", name="Bo", foot_lock=False, gender=2, state=1)
    server.answers["UpdateAgent"] = lambda _: agent_pb2.UpdateAgentResponse(agent=changed)
    agent = await session.update_agent("a", foot_lock=False)
    assert (agent.name, agent.foot_lock, agent.gender) == ("Bo", False, "male")
    (update,) = server.asked("UpdateAgent")
    assert update.HasField("foot_lock") and not update.HasField("name")


def clip_of(*batches: motion_pb2.StreamMotionResponse):
    header = motion_pb2.GenerateClipResponse(header=HEADER.header)
    return [header, *(motion_pb2.GenerateClipResponse(batch=part.batch) for part in batches)]


async def test_a_clip_becomes_a_track_and_a_file(server, client, tmp_path):
    server.scripts["GenerateClip"] = [clip_of(batch("", 0), batch("", 1, added=False))]
    clip = client.generate_clip(
        wf.AgentSpec(gender="male"), [wf.Goal((1, 0, 2))], 3.0, until_arrival=True, basis="ros"
    )
    (track,) = wf.tracks([found async for found in clip]).values()
    np.testing.assert_allclose(track.times, np.arange(16) / 40)
    assert track.rotations.shape == (16, 2, 4) and track.agent.name == "Ada"
    saved = np.load(track.save(tmp_path / "walk"))
    np.testing.assert_array_equal(saved["translation"], track.translation)
    (asked,) = server.asked("GenerateClip")
    assert (asked.seconds, asked.until_arrival, asked.basis) == (3.0, True, common_pb2.BASIS_ROS)


async def test_lock_step(server, client):
    skeleton = messages.header().skeleton
    server.answers["GetSkeleton"] = lambda _: catalog_pb2.GetSkeletonResponse(skeleton=skeleton)
    first, second = batch("", 0).batch, batch("", 1, added=False).batch
    done = motion_pb2.Event(kind=motion_pb2.EVENT_KIND_PATH_DONE, agent_id="a-1", alias=1)
    replies = [
        motion_pb2.StepAgentsResponse(batches=[first]),
        motion_pb2.StepAgentsResponse(batches=[second], events=[done]),
    ]
    server.answers["StepAgents"] = lambda _: replies.pop(0)
    session = await client.create_session(lock_step=True)
    (begun,) = await session.step()
    assert begun.added[0].name == "Ada" and begun.frames[0].rotations.shape == (8, 2, 4)
    later, events = await session.step(5)  # the agent is known from the first call
    assert later.frames[0].agent.name == "Ada"
    assert (events.events[0].kind, events.events[0].agent.name) == ("path_done", "Ada")
    assert [request.steps for request in server.asked("StepAgents")] == [1, 5]
    assert len(server.asked("GetSkeleton")) == 1


async def test_snapshots_and_replays(server, client):
    server.answers["ExportSession"] = lambda _: snapshot_pb2.ExportSessionResponse(snapshot=b"s")
    server.answers["ExportLog"] = lambda _: snapshot_pb2.ExportLogResponse(log=b"l")
    imported = session_pb2.Session(session_id="s", lease_s=9)
    server.answers["ImportSession"] = lambda _: snapshot_pb2.ImportSessionResponse(session=imported)
    session = await client.create_session()
    assert (await client.import_session(await session.export())).lease_s == 9
    server.scripts["Replay"] = [
        [
            snapshot_pb2.ReplayResponse(header=HEADER.header),
            snapshot_pb2.ReplayResponse(batch=batch("", 4).batch),
            Refusal(grpc.StatusCode.INTERNAL, "broken"),
        ]
    ]
    replay = client.replay(await session.export_log())
    assert (await anext(replay)).frames[0].seq == 4
    with pytest.raises(wf.InternalError, match="broken"):
        await anext(replay)
    assert server.asked("Replay")[0].log == b"l"


async def test_administration(server, client):
    model = catalog_pb2.Model(name="second")
    server.answers["LoadModel"] = lambda _: admin_pb2.LoadModelResponse(model=model)
    server.answers["UseModel"] = lambda _: admin_pb2.UseModelResponse(moved=3)
    assert (await client.admin.load_model("second")).name == "second"
    assert await client.admin.use_model("second", move_agents=True) == 3
    await client.admin.unload_model("first")
    await client.admin.drain()
    assert server.asked("UnloadModel")[0].name == "first"
    assert server.asked("UseModel")[0].move_agents and len(server.asked("Drain")) == 1


def test_sync_client_steps_and_streams():
    """In a program without an event loop; the fake runs in its own loop."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()

    def run(work):
        return asyncio.run_coroutine_threadsafe(work, loop).result(10)

    async def begin():
        fake = await FakeServer().__aenter__()
        fake.answers["CreateSession"] = new_session
        return fake

    fake = run(begin())
    try:
        fake.scripts["StreamMotion"] = [[HEADER, batch("t0"), GONE], [resumed(), batch("t1")]]
        fake.scripts["GenerateClip"] = [clip_of(batch("", 0))]
        with wf.SyncClient(fake.address) as client, client.create_session(lease=30) as session:
            assert [found.resume_token for found in session.stream()] == ["t0", "t1"]
            clip = client.generate_clip(wf.AgentSpec(), [], 1.0)
            assert math.isclose(wf.tracks(clip).popitem()[1].times[-1], 7 / 40)
            session.set_path("a", [wf.Goal((1, 0, 0)), wf.Goal((2, 0, 0))])
            session.wander("a", (0, 0, 0), 3.0)
            session.append_goals("a", [wf.Goal((0, 0, 1))])
        assert len(fake.asked("DeleteSession")) == 1
    finally:
        run(fake.__aexit__())
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
