"""What the Python client does when connections are lost, servers refuse, and others are quicker."""

import asyncio
import math
import threading

import grpc
import numpy as np
import pytest
from google.protobuf.duration_pb2 import Duration
from google.rpc.error_details_pb2 import BadRequest, RetryInfo

import wayfarer_client as wf
from tests.certificates import Authority
from tests.clients.fake_server import ASKED, FOREVER, FakeServer, Refusal
from tests.golden import messages
from wayfarer_client.v1 import (
    admin_pb2,
    agent_pb2,
    catalog_pb2,
    common_pb2,
    control_pb2,
    goal_pb2,
    motion_pb2,
    session_pb2,
    snapshot_pb2,
)

GONE = Refusal(grpc.StatusCode.UNAVAILABLE, "the server is shutting down")
HEADER = motion_pb2.StreamMotionResponse(
    header=motion_pb2.StreamHeader(
        server_version="1",
        session_id="s",
        fps=40,
        sent_fps=40,
        pose_encoding=motion_pb2.POSE_ENCODING_F32_LE,
        bones=[0, 1],
        skeleton=messages.header().skeleton,
    )
)
RESUMED = motion_pb2.StreamMotionResponse()
RESUMED.CopyFrom(HEADER)
RESUMED.header.resumed = True
HEARTBEAT = motion_pb2.StreamMotionResponse(heartbeat=motion_pb2.Heartbeat())


def batch(token: str, seq: int = 0, added: bool = True, flags: int = 0):
    agent = agent_pb2.Agent(agent_id="a-1", alias=1, name="Ada", gender=1, state=1)
    chunks = motion_pb2.MotionChunks(
        aliases=[1],
        seqs=[seq],
        first_frames=[8 * seq],
        scheduled_at_us=[200_000 * seq],
        goal_revisions=[0],
        states=[0],
        flags=[flags],
        poses=messages.float_poses(8),
        contacts=bytes(8),
        waypoints=[0],
        candidates=[0],
    )
    return motion_pb2.StreamMotionResponse(
        sent_at_us=5,
        batch=motion_pb2.MotionBatch(
            added=[agent] if added else [], chunks=chunks, resume_token=token
        ),
    )


def event(kind: int, **fields: object):
    return motion_pb2.StreamMotionResponse(event=motion_pb2.Event(kind=kind, **fields))


def new_session(request):
    session = session_pb2.Session(session_id="s", lease_s=request.lease_s or 60, seed=request.seed)
    return session_pb2.CreateSessionResponse(session=session)


@pytest.fixture
async def server():
    async with FakeServer() as running:
        running.answers["CreateSession"] = new_session
        yield running


@pytest.fixture
async def client(server):
    async with wf.Client(server.address) as connected:
        yield connected


# streams


async def test_a_lost_stream_goes_on_where_it_was(server, client):
    session = await client.create_session()
    server.scripts["StreamMotion"] = [
        [HEADER, batch("t0", 0, flags=1), batch("t1", 1, added=False), GONE],
        [GONE],
        [RESUMED, batch("t2", 2, added=False), batch("t3", 3, added=False)],
    ]
    stream = session.stream(format=wf.PoseFormat("smallest_three", fps=20), slow_reader="hold")
    batches = [found async for found in stream]
    assert [found.resume_token for found in batches] == ["t0", "t1", "t2", "t3"]
    assert [frames.seq for found in batches for frames in found] == [0, 1, 2, 3]
    assert [len(found.added) for found in batches] == [1, 0, 0, 0]
    asked = server.asked("StreamMotion")
    assert [request.resume_token for request in asked] == ["", "t1", "t1"]
    assert asked[2].format.encoding == motion_pb2.POSE_ENCODING_SMALLEST_THREE
    assert (asked[2].format.fps, asked[2].slow_reader) == (20, motion_pb2.SLOW_READER_HOLD)
    assert stream.reconnections == 2 and stream.resume_token == "t3"
    assert stream.info.resumed and stream.info.bones == ("pelvis", "left_hip")


async def test_a_gap_is_told(server, client):
    session = await client.create_session()
    told = event(motion_pb2.EVENT_KIND_GAP, at_us=2_000_000, detail="3.2 s are lost")
    server.scripts["StreamMotion"] = [
        [HEADER, batch("t0"), GONE],
        [HEADER, told, batch("t9", 16, flags=8)],
    ]
    first, gap, later = [found async for found in session.stream()]
    assert first.events == () and gap.frames == ()
    assert (gap.events[0].kind, gap.events[0].detail) == ("gap", "3.2 s are lost")
    assert gap.events[0].at == 2.0 and gap.events[0].agent is None
    assert later.frames[0].flags == wf.Flag.GAP
    assert len(later.added) == 1  # the stream began anew: agents are introduced again


async def test_events_name_their_agent(server, client):
    session = await client.create_session()
    kind = motion_pb2.EVENT_KIND_GOAL_REACHED
    server.scripts["StreamMotion"] = [
        [
            HEADER,
            batch("t0"),
            event(kind, agent_id="a-1", alias=1, goal_revision=4, waypoint=2),
            event(99),
        ]
    ]
    _, reached, unknown = [found async for found in session.stream()]
    (found,) = reached.events
    assert (found.kind, found.agent.name) == ("goal_reached", "Ada")
    assert (found.goal_revision, found.waypoint) == (4, 2)
    assert unknown.events[0].kind == ""  # of a later version: no reason to stop


async def test_a_session_that_is_no_more_is_told(server, client):
    session = await client.create_session()
    server.scripts["StreamMotion"] = [
        [HEADER, batch("t0"), GONE],
        [Refusal(grpc.StatusCode.NOT_FOUND, "no session 's'")],
    ]
    stream = session.stream()
    await anext(stream)
    with pytest.raises(wf.NotFound, match="no session 's'"):
        await anext(stream)


async def test_a_reader_that_was_cut_off_comes_back(server, client):
    """Also while the server still counts the stream that was lost."""
    session = await client.create_session()
    full = Refusal(grpc.StatusCode.RESOURCE_EXHAUSTED, "too slow, or too many streams")
    server.scripts["StreamMotion"] = [[HEADER, batch("t0"), full], [full], [RESUMED, batch("t1")]]
    stream = session.stream(slow_reader="disconnect")
    assert [found.resume_token async for found in stream] == ["t0", "t1"]
    server.scripts["StreamMotion"] = [[full]]
    with pytest.raises(wf.ResourceExhausted):  # the first time it is an answer
        await anext(session.stream())


async def test_a_silent_stream_is_given_up_a_speaking_one_is_kept(server, client, monkeypatch):
    monkeypatch.setattr("wayfarer_client.stream.SILENCE_S", 0.3)
    session = await client.create_session()

    def slowly(_):
        return HEARTBEAT

    server.scripts["StreamMotion"] = [
        [HEADER, batch("t0"), slowly, FOREVER],
        [RESUMED, batch("t1")],
    ]
    assert [found.resume_token async for found in session.stream()] == ["t0", "t1"]


async def test_a_stream_gives_up_after_its_deadline(server, client):
    session = await client.create_session()
    server.scripts["StreamMotion"] = [[GONE] for _ in range(50)]
    with pytest.raises(wf.Unavailable, match=r"no stream for 0\.5 s: the server is shutting down"):
        await anext(session.stream(deadline=0.5))


async def test_an_encoding_of_the_future_is_refused(server, client):
    session = await client.create_session()
    strange = motion_pb2.StreamMotionResponse(header=motion_pb2.StreamHeader(pose_encoding=77))
    server.scripts["StreamMotion"] = [[strange]]
    with pytest.raises(wf.WayfarerError, match="pose encoding 77"):
        await anext(session.stream())


# control


def replied(**fields: object):
    def reply(request: control_pb2.ControlRequest) -> control_pb2.ControlResponse:
        return control_pb2.ControlResponse(
            reply=control_pb2.CommandReply(command_id=request.command_id, **fields)
        )

    return reply


def moved(message: motion_pb2.StreamMotionResponse) -> control_pb2.ControlResponse:
    return control_pb2.ControlResponse(motion=message)


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


async def test_every_command_of_control(server, client):
    session = await client.create_session()
    server.scripts["Control"] = [
        [ASKED, moved(HEADER)] + [step for _ in range(4) for step in (ASKED, replied(revision=1))]
    ]
    async with session.control() as control:
        await control.set_path("a", [wf.Goal((1, 0, 0)), wf.Goal((2, 0, 0))])
        await control.append_goals("a", [wf.Goal((3, 0, 0))], expected=0)
        await control.wander("a", (0, 0, 0), 4.0, dwell=2.0)
        await control.set_goal("a", wf.Goal((0, 0, 0), speed=2.0))
    _, path, append, wander, goal = server.asked("Control")
    assert len(path.set_path.goals) == 2
    assert append.append_goals.HasField("expected_revision")
    assert (wander.wander.area.radius, wander.wander.dwell) == (4.0, 2.0)
    assert not wander.wander.HasField("speed")
    assert goal.set_goal.goal.speed == 2.0


async def test_control_comes_back_and_commands_under_way_fail(server, client):
    session = await client.create_session()
    server.scripts["Control"] = [
        [ASKED, moved(HEADER), moved(batch("t0")), ASKED, GONE],
        [ASKED, moved(RESUMED), ASKED, replied(revision=2), moved(batch("t1")), ASKED],
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


async def test_batches_that_nobody_takes_are_bounded_and_told(server, client):
    session = await client.create_session()
    sent = [moved(batch(f"t{seq}", seq)) for seq in range(100)]
    server.scripts["Control"] = [[ASKED, moved(HEADER), *sent]]
    async with session.control() as control:
        while control.resume_token != "t99":
            await asyncio.sleep(0.01)
        found = [batch async for batch in control]
    assert len(found) <= 65 and found[-1].frames[0].seq == 99
    assert any(event.kind == "gap" for batch in found for event in batch.events)


# sessions, creation, refusals


async def test_the_lease_is_renewed_until_the_end(server, client):
    async with await client.create_session(lease=0.3) as session:
        while len(server.asked("RenewSession")) < 2:
            await asyncio.sleep(0.01)
    renewed = len(server.asked("RenewSession"))
    assert [request.session_id for request in server.asked("DeleteSession")] == ["s"]
    await asyncio.sleep(0.25)
    assert len(server.asked("RenewSession")) == renewed
    assert session.lease_s == pytest.approx(0.3)


async def test_renewing_outlives_a_lost_connection_but_not_the_session(server, client):
    refusals = [GONE, Refusal(grpc.StatusCode.NOT_FOUND, "no session")]

    def renew(_):
        raise refusals.pop(0)

    server.answers["RenewSession"] = renew
    async with await client.create_session(lease=0.15):
        while refusals:
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.2)
    assert len(server.asked("RenewSession")) == 2


async def test_a_session_that_was_joined_lives_on(server, client):
    session = session_pb2.Session(session_id="s", lease_s=60)
    server.answers["GetSession"] = lambda _: session_pb2.GetSessionResponse(session=session)
    async with await client.session("s") as joined:
        assert not joined.owned
    assert server.asked("DeleteSession") == []


async def test_a_create_is_sent_again_under_the_same_id(server, client):
    failing = [GONE, GONE]

    def create(request):
        if failing:
            raise failing.pop()
        return new_session(request)

    server.answers["CreateSession"] = create
    await client.create_session("unity", seed=0, record=True, lock_step=True)
    ids = [request.request_id for request in server.asked("CreateSession")]
    assert len(ids) == 3 and len(set(ids)) == 1 and len(ids[0]) == 36
    request = server.asked("CreateSession")[0]
    assert request.HasField("seed") and request.record and request.lock_step
    assert not request.HasField("lease_s")


async def test_other_calls_are_not_sent_again(server, client):
    def refuse(_):
        raise GONE

    server.answers["SetGoal"] = refuse
    session = await client.create_session()
    with pytest.raises(wf.Unavailable):
        await session.set_goal("a", (0, 0, 0))
    assert len(server.asked("SetGoal")) == 1


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
            (RetryInfo(retry_delay=Duration(seconds=1, nanos=500_000_000)),),
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
    assert full.value.retry_after == 1.5
    with pytest.raises(wf.Aborted, match="revision 4"):
        await session.set_path("a", [], expected=3)
    assert server.asked("SetPath")[1].expected_revision == 3


async def test_goals(server, client):
    session = await client.create_session()
    server.answers["AppendGoals"] = lambda _: goal_pb2.AppendGoalsResponse(revision=3)
    server.answers["Wander"] = lambda _: goal_pb2.WanderResponse(revision=4)
    assert await session.append_goals("a", [wf.Goal((1, 0, 0))], expected=2) == 3
    assert await session.wander("a", (1, 0, 2), 5.0, speed=0.8) == 4
    (wander,) = server.asked("Wander")
    assert (wander.area.center.z, wander.area.radius, wander.speed) == (2, 5.0, 0.8)
    changed = agent_pb2.Agent(agent_id="a", name="Bo", foot_lock=False, gender=2, state=1)
    server.answers["UpdateAgent"] = lambda _: agent_pb2.UpdateAgentResponse(agent=changed)
    agent = await session.update_agent("a", foot_lock=False)
    assert (agent.name, agent.foot_lock, agent.gender) == ("Bo", False, "male")
    (update,) = server.asked("UpdateAgent")
    assert update.HasField("foot_lock") and not update.HasField("name")


# who calls


@pytest.mark.parametrize(
    ("access", "headers"),
    [
        ({}, {}),
        ({"api_key": "wf_secret"}, {"x-api-key": "wf_secret"}),
        ({"token": "eyJ"}, {"authorization": "Bearer eyJ"}),
        ({"token": lambda: "fresh"}, {"authorization": "Bearer fresh"}),
    ],
)
async def test_credentials_go_with_every_call_and_stream(server, access, headers):
    async with wf.Client(server.address, **access) as client:
        session = await client.create_session()
        server.scripts["StreamMotion"] = [[HEADER, batch("t0")]]
        server.scripts["Control"] = [[ASKED, moved(HEADER), moved(batch("t0")), ASKED]]
        assert [found async for found in session.stream()]
        async with session.control() as control:
            await anext(control)
        assert "secret" not in repr(client.connection._access)
    assert len(server.metadata) == 3
    for found in server.metadata:
        shown = {key: found[key] for key in ("x-api-key", "authorization") if key in found}
        assert shown == headers


def test_tls_files_are_checked(tmp_path):
    with pytest.raises(wf.InvalidArgument, match="belong together"):
        wf.Tls(certificate=tmp_path / "a").credentials()
    with pytest.raises(wf.InvalidArgument, match=r"missing\.pem: No such file"):
        wf.Tls(ca=tmp_path / "missing.pem").credentials()


async def test_mutual_tls(tmp_path):
    authority = Authority(tmp_path)
    cert, key = authority.issue("server")
    credentials = grpc.ssl_server_credentials(
        [(key.read_bytes(), cert.read_bytes())],
        authority.path.read_bytes(),
        require_client_auth=True,
    )
    certificate, private = authority.issue("client")
    async with FakeServer(credentials) as server:
        server.answers["CreateSession"] = new_session
        tls = wf.Tls(authority.path, certificate, private)
        async with wf.Client(server.address, tls=tls, api_key="wf_k") as client:
            await client.create_session()
        assert server.metadata[0]["x-api-key"] == "wf_k"
        named = wf.Tls(authority.path, certificate, private, server_name="localhost")
        async with wf.Client(server.address, tls=named) as client:
            await client.create_session()
        for tls in (None, wf.Tls(), wf.Tls(authority.path)):
            with pytest.raises(wf.Unavailable, match="no server at"):
                await wf.Client(server.address, timeout=0.5, tls=tls).connect()


# clips, lock-step, snapshots


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
    """In a program without an event loop; the fake runs in a loop of its own."""
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
        fake.scripts["StreamMotion"] = [[HEADER, batch("t0"), GONE], [RESUMED, batch("t1")]]
        fake.scripts["GenerateClip"] = [clip_of(batch("", 0))]
        with wf.SyncClient(fake.address) as client, client.create_session(lease=30) as session:
            assert [found.resume_token for found in session.stream()] == ["t0", "t1"]
            clip = client.generate_clip(wf.AgentSpec(), [], 1.0)
            assert math.isclose(wf.tracks(clip).popitem()[1].times[-1], 7 / 40)
            session.wander("a", (0, 0, 0), 3.0)
            session.append_goals("a", [wf.Goal((0, 0, 1))])
        assert len(fake.asked("DeleteSession")) == 1
    finally:
        run(fake.__aexit__())
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
