import asyncio
import base64
import json

import grpc
import pytest
import websockets
from google.rpc.error_details_pb2 import ErrorInfo
from google.rpc.status_pb2 import Status
from grpc_health.v1 import health_pb2, health_pb2_grpc

from tests.transport.auth.test_keys import FILE, STUDIO
from tests.transport.rig import until
from tests.workers.fleet import Rig
from wayfarer.v1 import (
    admin_pb2,
    admin_pb2_grpc,
    agent_pb2,
    agent_pb2_grpc,
    catalog_pb2,
    catalog_pb2_grpc,
    control_pb2,
    control_pb2_grpc,
    goal_pb2,
    goal_pb2_grpc,
    motion_pb2,
    motion_pb2_grpc,
    session_pb2,
    session_pb2_grpc,
    snapshot_pb2,
    snapshot_pb2_grpc,
)


@pytest.fixture
async def rig(tmp_path):
    async with Rig(tmp_path) as running:
        yield running


def sessions_of(channel) -> session_pb2_grpc.SessionServiceStub:
    return session_pb2_grpc.SessionServiceStub(channel)


async def two(rig) -> tuple[dict, dict]:
    """A session in each worker."""
    one, other = [(await rig.session())[0] for _ in range(2)]
    assert {one["endpoint"]["worker"], other["endpoint"]["worker"]} == {0, 1}
    return one, other


# Sessions are spread, and found


async def test_new_sessions_are_spread_and_say_where_they_live(rig):
    made = [
        (await sessions_of(rig.channel).CreateSession(session_pb2.CreateSessionRequest())).session
        for _ in range(4)
    ]
    assert sorted(session.endpoint.worker for session in made) == [0, 0, 1, 1]
    for session in made:
        assert session.endpoint.grpc_port in [
            int(server.grpc_address.rpartition(":")[2]) for server in rig.servers
        ]
    listed = await sessions_of(rig.channel).ListSessions(session_pb2.ListSessionsRequest())
    assert {s.session_id for s in listed.sessions} == {s.session_id for s in made}


async def test_calls_find_their_worker_by_the_session_and_by_the_agent(rig):
    for _ in range(2):
        session, people = await rig.session()
        path = f"/v1/sessions/{session['session_id']}"
        assert (await rig.http.get(path)).json()["session_id"] == session["session_id"]
        goal = {"position": {"x": 1, "y": 0, "z": 2}}
        agent = people[1]["agent_id"]
        assert (await rig.http.put(f"/v1/agents/{agent}/goal", json=goal)).json()["revision"] == 1
        request = goal_pb2.SetGoalRequest(agent_id=agent, goal={"position": {"x": 1, "z": 3}})
        reply = await goal_pb2_grpc.GoalServiceStub(rig.channel).SetGoal(request)
        assert reply.revision == 2
        assert [name for name, _ in rig.service(session).commands] == [agent, agent]
        assert (await rig.http.delete(path)).status_code == 204
        assert (await rig.http.get(path)).status_code == 404


async def test_a_create_that_is_sent_twice_makes_one_session(rig):
    request = session_pb2.CreateSessionRequest(request_id="once")
    sent = [await sessions_of(rig.channel).CreateSession(request) for _ in range(3)]
    posted = [
        (await rig.http.post("/v1/sessions", json={}, headers={"idempotency-key": "two"})).json()
        for _ in range(3)
    ]
    assert len({reply.session.session_id for reply in sent}) == 1
    assert len({session["session_id"] for session in posted}) == 1
    assert sum(service.created for service in rig.services) == 2


async def test_a_worker_tells_who_calls_for_anothers_session_where_it_lives(rig):
    here, there = await two(rig)
    port, right = here["endpoint"]["grpc_port"], there["endpoint"]
    async with grpc.aio.insecure_channel(f"127.0.0.1:{port}") as channel:
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            request = session_pb2.GetSessionRequest(session_id=there["session_id"])
            await sessions_of(channel).GetSession(request)
    assert caught.value.code() is grpc.StatusCode.FAILED_PRECONDITION
    metadata = dict(caught.value.trailing_metadata())
    info = ErrorInfo()
    assert Status.FromString(metadata["grpc-status-details-bin"]).details[0].Unpack(info)
    assert info.reason == "MISDIRECTED"
    assert dict(info.metadata) == {key: str(value) for key, value in right.items()}
    http = f"http://127.0.0.1:{here['endpoint']['http_port']}"
    answer = await rig.http.get(f"{http}/v1/sessions/{there['session_id']}")
    assert answer.status_code == 421 and answer.json()["endpoint"] == right


async def test_a_session_comes_back_to_where_its_id_says(rig):
    snapshots = snapshot_pb2_grpc.SnapshotServiceStub(rig.channel)
    for _ in range(2):
        session, people = await rig.session()
        session_id = session["session_id"]
        exported = await snapshots.ExportSession(
            snapshot_pb2.ExportSessionRequest(session_id=session_id)
        )
        # the fakes' snapshots do not say whose they are: this one goes to the first worker
        assert (await rig.http.delete(f"/v1/sessions/{session_id}")).status_code == 204
        request = snapshot_pb2.ImportSessionRequest(snapshot=exported.snapshot)
        if session["endpoint"]["worker"] == 0:
            reply = await snapshots.ImportSession(request)
            assert list(reply.session.agent_ids) == [agent["agent_id"] for agent in people]
        else:  # and what has come to the wrong worker does not stay there
            with pytest.raises(grpc.aio.AioRpcError, match="lives in worker 1"):
                await snapshots.ImportSession(request)
            assert session_id not in rig.services[0]._sessions


# Streams


async def test_streams_come_through_over_grpc_and_end_with_the_session(rig):
    session, _ = await rig.session()
    stub = motion_pb2_grpc.MotionServiceStub(rig.channel)
    call = stub.StreamMotion(motion_pb2.StreamMotionRequest(session_id=session["session_id"]))
    assert (await call.read()).header.session_id == session["session_id"]
    rig.service(session).emit(session["session_id"])
    assert len((await call.read()).batch.chunks.seqs) == 2
    await rig.http.delete(f"/v1/sessions/{session['session_id']}")
    assert await call.read() is grpc.aio.EOF and await call.code() is grpc.StatusCode.OK


async def test_a_reader_that_leaves_is_gone_from_its_worker_too(rig):
    session, _ = await rig.session()
    stub = motion_pb2_grpc.MotionServiceStub(rig.channel)
    call = stub.StreamMotion(motion_pb2.StreamMotionRequest(session_id=session["session_id"]))
    await call.read()
    address = f"{rig.ws_url}/v1/stream?session={session['session_id']}"
    async with websockets.connect(address) as socket:
        await socket.recv()
        (gateway,) = [gateway for gateway in rig.gateways if gateway.streams]
        assert gateway.streams == 2
    call.cancel()
    await until(lambda: gateway.streams == 0)


async def test_control_goes_up_and_motion_down(rig):
    session, people = await rig.session()
    opened = control_pb2.ControlRequest(open={"session_id": session["session_id"]})
    command = control_pb2.ControlRequest(
        command_id=7, clear_goal=goal_pb2.ClearGoalRequest(agent_id=people[0]["agent_id"])
    )
    call = control_pb2_grpc.ControlServiceStub(rig.channel).Control()
    await call.write(opened)
    assert (await call.read()).motion.HasField("header")
    await call.write(command)
    assert (await call.read()).reply.command_id == 7
    call.cancel()
    async with websockets.connect(
        f"{rig.ws_url}/v1/control", subprotocols=["wayfarer.v1"]
    ) as socket:
        assert socket.subprotocol == "wayfarer.v1"
        await socket.send(opened.SerializeToString())
        first = control_pb2.ControlResponse.FromString(await socket.recv())
        assert first.motion.header.session_id == session["session_id"]
        await socket.send(command.SerializeToString())
        assert control_pb2.ControlResponse.FromString(await socket.recv()).reply.command_id == 7


async def test_sockets_bring_frames_and_tell_why_they_close(rig):
    session, _ = await rig.session()
    address = f"{rig.ws_url}/v1/stream?session={session['session_id']}"
    async with websockets.connect(address, subprotocols=["wayfarer.v1"]) as socket:
        assert socket.subprotocol == "wayfarer.v1"
        header = motion_pb2.StreamMotionResponse.FromString(await socket.recv())
        assert header.header.session_id == session["session_id"]
        rig.service(session).emit(session["session_id"])
        chunks = motion_pb2.StreamMotionResponse.FromString(await socket.recv()).batch.chunks
        assert len(chunks.seqs) == 2
        await rig.http.delete(f"/v1/sessions/{session['session_id']}")
        with pytest.raises(websockets.ConnectionClosedOK):
            await socket.recv()
    for path, frame, code in (
        ("stream?session=session-0000", None, 4404),
        ("control", b"\xff", 4422),
        ("control", b"", 4422),
    ):
        async with websockets.connect(f"{rig.ws_url}/v1/{path}") as socket:
            if frame is not None:
                await socket.send(frame)
            with pytest.raises(websockets.ConnectionClosedError) as closed:
                await socket.recv()
            assert closed.value.rcvd.code == code, closed.value


async def test_events_come_through_as_they_happen(rig):
    session, _ = await rig.session()
    async with rig.http.stream("GET", f"/v1/events?session={session['session_id']}") as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        await until(lambda: rig.service(session).subscriptions)
    await until(lambda: all(s.closed for s in rig.service(session).subscriptions))


# What concerns all


async def test_models_are_loaded_in_all_workers(rig):
    admin = admin_pb2_grpc.AdminServiceStub(rig.channel)
    await admin.LoadModel(admin_pb2.LoadModelRequest(name="v2"))
    assert all("v2" in [m.name for m in service.models] for service in rig.services)
    await two(rig)
    answer = await rig.http.post("/v1/admin/models/v2/use", json={"move_agents": True})
    assert answer.json() == {"moved": 4}
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await admin.UnloadModel(admin_pb2.UnloadModelRequest(name="v2"))
    assert caught.value.code() is grpc.StatusCode.FAILED_PRECONDITION
    assert (await rig.http.delete("/v1/admin/models/fake")).status_code == 204
    assert (await rig.http.delete("/v1/admin/models/fake")).status_code == 404


async def test_figures_of_all_are_added_and_told_apart(rig):
    assert (await rig.http.get("/v1/stats")).json()["steps"] == 20
    page = (await rig.http.get("/metrics")).text
    for worker in "01":
        assert f'wayfarer_sessions{{worker="{worker}"}} 1.0' in page
        assert f'wayfarer_worker_ready{{worker="{worker}"}} 1.0' in page
    assert page.count("# TYPE wayfarer_sessions gauge") == 1


async def test_what_all_can_do_is_done_by_one(rig):
    info = await catalog_pb2_grpc.CatalogServiceStub(rig.channel).GetServerInfo(
        catalog_pb2.GetServerInfoRequest()
    )
    assert info.fps == 40
    assert (await rig.http.get("/")).headers["content-type"].startswith("text/html")
    assert "/v1/sessions" in (await rig.http.get("/openapi.json")).json()["paths"]
    mesh = await rig.http.get("/v1/bodies/anny52-male.glb?detail=low")
    assert mesh.content[:4] == b"glTF" and mesh.headers["etag"]
    same = await rig.http.get(
        "/v1/bodies/anny52-male.glb?detail=low", headers={"if-none-match": mesh.headers["etag"]}
    )
    assert same.status_code == 304
    clip = {"seconds": 0.4, "goals": [{"position": {"x": 0, "y": 0, "z": 1}}]}
    lines = (await rig.http.post("/v1/clips", json=clip)).text.splitlines()
    assert json.loads(lines[0])["header"]["fps"] == 40 and len(lines) > 1


# Trouble


async def test_a_worker_that_is_down_takes_only_its_own_sessions_with_it(rig):
    here, there = await two(rig)
    gone = there["endpoint"]["worker"]
    health = health_pb2_grpc.HealthStub(rig.channel)
    check = health_pb2.HealthCheckRequest()
    await until_serving(health, check, True)
    stub = motion_pb2_grpc.MotionServiceStub(rig.channel)
    call = stub.StreamMotion(motion_pb2.StreamMotionRequest(session_id=there["session_id"]))
    await call.read()
    await rig.stop_worker(gone)
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        while await call.read() is not grpc.aio.EOF:
            pass
        await call
    assert caught.value.code() is grpc.StatusCode.UNAVAILABLE
    assert (await rig.http.get(f"/v1/sessions/{here['session_id']}")).status_code == 200
    lost = await rig.http.get(f"/v1/sessions/{there['session_id']}")
    assert lost.status_code == 503 and lost.headers["retry-after"] == "1"
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await agent_pb2_grpc.AgentServiceStub(rig.channel).ListAgents(
            agent_pb2.ListAgentsRequest(session_id=there["session_id"])
        )
    assert caught.value.code() is grpc.StatusCode.UNAVAILABLE
    async with websockets.connect(f"{rig.ws_url}/v1/stream?session={there['session_id']}") as lost:
        with pytest.raises(websockets.ConnectionClosedError) as closed:
            await lost.recv()
        assert closed.value.rcvd.code == 4503
    new = [(await rig.session())[0]["endpoint"]["worker"] for _ in range(2)]
    assert new == [1 - gone] * 2
    ready = await rig.http.get("/v1/health/ready")
    assert ready.status_code == 503 and ready.json()["workers"][gone] == "down"
    assert (await rig.http.get("/v1/health/live")).status_code == 200
    assert f'wayfarer_worker_ready{{worker="{gone}"}} 0.0' in (await rig.http.get("/metrics")).text
    await until_serving(health, check, False)


async def until_serving(health, check, serving: bool) -> None:
    async with asyncio.timeout(10):
        wanted = health_pb2.HealthCheckResponse.SERVING if serving else 2
        while (await health.Check(check)).status != wanted:
            await asyncio.sleep(0.05)


async def test_what_a_client_makes_up_about_itself_is_not_believed(rig):
    lies = {"x-wayfarer-certificate": "root", "x-wayfarer-address": "10.0.0.9"}
    keys = {"x-api-key": "wf_mine", "authorization": "Bearer mine"}
    await rig.http.get("/v1/info", headers={**lies, **keys})
    stub = catalog_pb2_grpc.CatalogServiceStub(rig.channel)
    request = catalog_pb2.GetServerInfoRequest()
    await stub.GetServerInfo(request, metadata=tuple({**lies, **keys}.items()))
    address = f"{rig.ws_url}/v1/stream?session=session-0000"
    async with websockets.connect(address, additional_headers={**lies, **keys}):
        pass
    # nor at a worker's own ports
    worker = rig.servers[0]
    await rig.http.get(f"{worker.http_url}/v1/info", headers={**lies, **keys})
    async with grpc.aio.insecure_channel(worker.grpc_address) as channel:
        stub = catalog_pb2_grpc.CatalogServiceStub(channel)
        await stub.GetServerInfo(request, metadata=tuple({**lies, **keys}.items()))
    assert len(rig.guard.seen) == 5
    for shown, address in rig.guard.seen:
        assert (shown.certificate, address) == ("", "127.0.0.1")
        assert (shown.api_key, shown.bearer) == ("wf_mine", "mine")


async def test_a_request_that_is_too_large_or_malformed_is_refused(rig):
    answer = await rig.http.post("/v1/sessions", content=b"x" * 20_000)
    assert answer.status_code == 413
    assert (await rig.http.post("/v1/sessions", content=b"{")).status_code == 422
    assert (await rig.http.get("/v1/nothing")).status_code == 404
    assert (await rig.http.put("/v1/sessions", json={})).status_code == 405
    method = rig.channel.unary_unary("/wayfarer.v1.SessionService/GetSession")
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await method(b"\xff")
    assert caught.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await rig.channel.unary_unary("/wayfarer.v1.SessionService/Nothing")(b"")
    assert caught.value.code() is grpc.StatusCode.UNIMPLEMENTED


async def test_deadlines_are_handed_on(rig):
    rig.services[0].slow = rig.services[1].slow = asyncio.Event()
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await sessions_of(rig.channel).CreateSession(
            session_pb2.CreateSessionRequest(), timeout=0.5
        )
    assert caught.value.code() is grpc.StatusCode.DEADLINE_EXCEEDED


async def test_who_never_says_what_it_wants_is_let_go(rig, monkeypatch):
    monkeypatch.setattr("wayfarer.workers.grpc_relay.FIRST_S", 0.2)
    monkeypatch.setattr("wayfarer.workers.socket_relay.FIRST_S", 0.2)
    call = control_pb2_grpc.ControlServiceStub(rig.channel).Control()
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await call.read()
    assert caught.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    async with websockets.connect(f"{rig.ws_url}/v1/control") as socket:
        with pytest.raises(websockets.ConnectionClosedError) as closed:
            await socket.recv()
        assert closed.value.rcvd.code == 4422


async def refused_at_once(address: str, **options) -> websockets.Close:
    """How a socket is closed on which nothing is sent."""
    async with asyncio.timeout(10), websockets.connect(address, **options) as socket:
        with pytest.raises(websockets.ConnectionClosedError) as closed:
            await socket.recv()
        return closed.value.rcvd


async def test_who_calls_is_asked_at_the_handshake(tmp_path):
    (tmp_path / "keys.toml").write_text(FILE)
    async with Rig(tmp_path, keys=tmp_path / "keys.toml") as rig:
        for path in ("control", "stream?session=session-0000"):
            address = f"{rig.ws_url}/v1/{path}"
            assert (await refused_at_once(address)).code == 4401
            wrong = {"x-api-key": "wf_no"}
            assert (await refused_at_once(address, additional_headers=wrong)).code == 4401
            key = {"x-api-key": STUDIO}
            page = await refused_at_once(
                address, additional_headers=key, origin="https://evil.example"
            )
            assert page.code == 4403 and "cors_origins" in page.reason
        assert rig.guard.seen == []  # no worker was troubled
        text = base64.urlsafe_b64encode(STUDIO.encode()).decode().rstrip("=")
        offered = ["wayfarer.v1", f"wayfarer.token.{text}"]
        async with websockets.connect(f"{rig.ws_url}/v1/control", subprotocols=offered) as socket:
            assert socket.subprotocol == "wayfarer.v1"
            await socket.send(b"\xff")  # the worker is shown the token, too
            with pytest.raises(websockets.ConnectionClosedError):
                await socket.recv()
        assert [shown.bearer for shown, _ in rig.guard.seen] == [STUDIO]


async def test_a_foreign_name_that_points_here_reads_nothing(rig):
    port = rig.front.http_url.rpartition(":")[2]
    for path in ("/v1/sessions", "/v1/info", "/metrics", "/docs/", "/openapi.json", "/"):
        answer = await rig.http.get(path, headers={"host": f"evil.example:{port}"})
        assert answer.status_code == 403, path
    for path in ("control", "stream?session=session-0000"):
        address = f"ws://evil.example:{port}/v1/{path}"
        closed = await refused_at_once(address, host="127.0.0.1", port=int(port))
        assert closed.code == 4403 and "allowed_hosts" in closed.reason
