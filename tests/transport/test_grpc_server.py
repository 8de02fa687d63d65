"""gRPC, called by a real client."""

import grpc
import numpy as np
import pytest
from google.rpc.error_details_pb2 import BadRequest
from grpc_reflection.v1alpha import reflection_pb2, reflection_pb2_grpc
from grpc_status import rpc_status

from tests.runtime.running import until
from tests.transport.rig import others_are_undisturbed
from tests.wire_poses import decode
from wayfarer.transport.conversion.basis import Basis
from wayfarer.v1 import (
    agent_pb2,
    control_pb2,
    motion_pb2,
    motion_pb2_grpc,
    session_pb2,
    snapshot_pb2,
)


async def test_grpc_from_session_to_frames(rig):
    made = await rig.sessions.CreateSession(session_pb2.CreateSessionRequest(basis="BASIS_ROS"))
    of = {"session_id": made.session.session_id}
    assert made.session.basis.basis == 6 and made.session.basis.right_handed
    spec = {"gender": "GENDER_MALE", "seed": 5, "position": {"x": 2.0}, "name": "Ada"}
    request = agent_pb2.CreateAgentsRequest(**of, agents=[spec])
    (agent,) = (await rig.agents.CreateAgents(request)).agents
    assert (agent.name, agent.seed, agent.gender) == ("Ada", 5, agent_pb2.GENDER_MALE)
    assert rig.service.specs[0].position == (0.0, 2.0)  # ROS x is core y

    call = rig.motion.StreamMotion(motion_pb2.StreamMotionRequest(**of))
    assert (await call.read()).header.skeleton.posed_bones == 22
    (sent,) = rig.service.emit(of["session_id"])
    batch = (await call.read()).batch
    assert batch.added[0].agent_id == agent.agent_id
    chunks = batch.chunks
    assert list(chunks.aliases) == [agent.alias]
    assert list(chunks.flags) == [motion_pb2.CHUNK_FLAG_FIRST]
    assert (list(chunks.waypoints), list(chunks.candidates)) == ([5], [4])
    assert list(chunks.states) == [agent_pb2.AGENT_STATE_STANDING]
    translation, rotations, contacts = decode(chunks.poses, chunks.contacts, Basis.ROS)
    np.testing.assert_allclose(translation, sent.translation, atol=1e-6)
    np.testing.assert_array_equal(rotations, sent.rotations)
    np.testing.assert_array_equal(contacts, sent.contacts)

    listed = await rig.agents.ListAgents(agent_pb2.ListAgentsRequest(**of))
    got = await rig.agents.GetAgent(agent_pb2.GetAgentRequest(agent_id=agent.agent_id))
    assert list(listed.agents) == [got.agent]
    await rig.agents.DeleteAgent(agent_pb2.DeleteAgentRequest(agent_id=agent.agent_id))
    await rig.sessions.DeleteSession(session_pb2.DeleteSessionRequest(**of))
    while (message := await call.read()) is not grpc.aio.EOF:
        assert not message.batch.HasField("chunks")
    assert await call.code() == grpc.StatusCode.OK


async def test_grpc_errors_carry_details(rig):
    request = agent_pb2.CreateAgentsRequest(session_id="none", agents=[{"betas": [9.0]}])
    call = rig.agents.CreateAgents(request)
    with pytest.raises(grpc.aio.AioRpcError):
        await call
    status = await rpc_status.aio.from_call(call)
    violations = BadRequest()
    assert any(packed.Unpack(violations) for packed in status.details)
    assert violations.field_violations[0].field == "agents[0].betas[0]"


async def test_a_large_grpc_message_is_refused(rig):
    request = agent_pb2.CreateAgentsRequest(session_id="x" * 10_000)
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await rig.agents.CreateAgents(request)
    assert caught.value.code() == grpc.StatusCode.RESOURCE_EXHAUSTED


async def test_a_grpc_client_that_vanishes_is_cleaned_up(rig):
    session_id, _ = await rig.session()
    channel = grpc.aio.insecure_channel(rig.server.grpc_address)
    call = motion_pb2_grpc.MotionServiceStub(channel).StreamMotion(
        motion_pb2.StreamMotionRequest(session_id=session_id)
    )
    await call.read()
    await channel.close()
    await until(lambda: rig.service.subscriptions[0].closed)
    await others_are_undisturbed(rig, session_id)


async def test_reflection_lists_the_services(rig):
    stub = reflection_pb2_grpc.ServerReflectionStub(rig.channel)
    call = stub.ServerReflectionInfo(
        iter([reflection_pb2.ServerReflectionRequest(list_services="")])
    )
    names = {s.name for s in (await call.read()).list_services_response.service}
    assert {"wayfarer.v1.MotionService", "grpc.health.v1.Health"} <= names
    call.cancel()


async def code_of(call) -> grpc.StatusCode:
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await call
    return caught.value.code()


async def test_grpc_moves_and_replays_sessions(rig):
    request = session_pb2.CreateSessionRequest(record=True)
    session_id = (await rig.sessions.CreateSession(request)).session.session_id
    of = {"session_id": session_id}
    exported = await rig.snapshots.ExportSession(snapshot_pb2.ExportSessionRequest(**of))
    log = (await rig.snapshots.ExportLog(snapshot_pb2.ExportLogRequest(**of))).log
    back = snapshot_pb2.ImportSessionRequest(snapshot=exported.snapshot)
    assert await code_of(rig.snapshots.ImportSession(back)) == grpc.StatusCode.ALREADY_EXISTS
    await rig.sessions.DeleteSession(session_pb2.DeleteSessionRequest(**of))
    assert (await rig.snapshots.ImportSession(back)).session.session_id == session_id
    replay = rig.snapshots.Replay(snapshot_pb2.ReplayRequest(log=log, format={"fps": 10}))
    header, *batches = [message async for message in replay]
    assert header.header.sent_fps == 10 and len(batches) == 2
    unknown = rig.snapshots.Replay(snapshot_pb2.ReplayRequest(log=log, format={"encoding": 9}))
    assert await code_of(unknown.read()) == grpc.StatusCode.INVALID_ARGUMENT


async def test_control_over_grpc(rig):
    session_id, (agent, _) = await rig.session()
    call = rig.control.Control()
    await call.write(control_pb2.ControlRequest(open={"session_id": session_id}))
    assert (await call.read()).motion.header.session_id == session_id
    clear = {"agent_id": agent["agent_id"]}
    await call.write(control_pb2.ControlRequest(command_id=1, clear_goal=clear))
    assert (await call.read()).reply.revision == 1
    rig.service.emit(session_id)
    token = (await call.read()).motion.batch.resume_token
    await call.write(control_pb2.ControlRequest(ack={"resume_token": token}))
    await until(lambda: rig.service.subscriptions[0].acks == [(1, 0.0)])
    await call.done_writing()  # the stream continues
    rig.service.emit(session_id)
    assert len((await call.read()).motion.batch.chunks.aliases) == 2
    call.cancel()
    await until(lambda: rig.service.subscriptions[0].closed)
    await others_are_undisturbed(rig, session_id)


@pytest.mark.parametrize("path", ["SessionService/CreateSession", "MotionService/StreamMotion"])
async def test_bytes_that_are_no_message_are_the_clients_fault(rig, path):
    method = f"/wayfarer.v1.{path}"
    if path.endswith("StreamMotion"):
        call = rig.channel.unary_stream(method)(b"\xff\xff\xff").read()
    else:
        call = rig.channel.unary_unary(method)(b"\xff\xff\xff")
    assert await code_of(call) == grpc.StatusCode.INVALID_ARGUMENT


async def test_bytes_that_are_no_message_end_control(rig):
    session_id, _ = await rig.session()
    call = rig.channel.stream_stream("/wayfarer.v1.ControlService/Control")()
    opening = control_pb2.ControlRequest(open={"session_id": session_id})
    await call.write(opening.SerializeToString())
    await call.read()
    await call.write(b"\xff\xff\xff")
    assert await code_of(call.read()) == grpc.StatusCode.INVALID_ARGUMENT
    await until(lambda: rig.service.subscriptions[0].closed)
