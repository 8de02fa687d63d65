"""gRPC, spoken to by a real client."""

import grpc
import numpy as np
import pytest
from google.rpc.error_details_pb2 import BadRequest
from grpc_reflection.v1alpha import reflection_pb2, reflection_pb2_grpc
from grpc_status import rpc_status

from tests.transport.rig import others_are_undisturbed, until
from wayfarer.transport import codec
from wayfarer.transport.basis import Basis
from wayfarer.v1 import (
    agent_pb2,
    goal_pb2,
    motion_pb2,
    motion_pb2_grpc,
    session_pb2,
)


async def test_grpc_from_session_to_frames(rig):
    made = await rig.sessions.CreateSession(session_pb2.CreateSessionRequest(basis="BASIS_ROS"))
    session_id = made.session.session_id
    assert made.session.basis.basis == 6 and made.session.basis.right_handed
    agents = await rig.agents.CreateAgents(
        agent_pb2.CreateAgentsRequest(
            session_id=session_id,
            agents=[{"gender": "GENDER_MALE", "seed": 5, "position": {"x": 2.0}, "name": "Ada"}],
        )
    )
    (agent,) = agents.agents
    assert (agent.name, agent.seed, agent.gender) == ("Ada", 5, agent_pb2.GENDER_MALE)
    assert rig.service.specs[0].position == (0.0, 2.0)  # ROS x is core y
    goal = await rig.goals.SetGoal(
        goal_pb2.SetGoalRequest(agent_id=agent.agent_id, goal={"position": {"y": 3}, "radius": 0.5})
    )
    assert goal.revision == 1
    assert rig.service.goals[0][1].position == (-3.0, 0.0, 0.0)
    assert rig.service.goals[0][1].radius == 0.5

    path = await rig.goals.SetPath(
        goal_pb2.SetPathRequest(
            agent_id=agent.agent_id,
            goals=[
                {"position": {"x": 1.0}, "stop": False},
                {"position": {"x": 2.0}, "heading": 0.5, "strafe": True, "dwell": 3.0},
            ],
        )
    )
    assert path.revision == 3
    first, second = (goal for _, goal in rig.service.goals[1:])
    assert first.position == (0.0, 1.0, 0.0) and not first.stop and first.heading is None
    assert (second.heading, second.stop, second.strafe, second.dwell) == (0.5, True, True, 3.0)

    call = rig.motion.StreamMotion(motion_pb2.StreamMotionRequest(session_id=session_id))
    assert (await call.read()).header.skeleton.posed_bones == 22
    (sent,) = rig.service.emit(session_id)
    batch = (await call.read()).batch
    assert batch.added[0].agent_id == agent.agent_id
    (chunk,) = batch.chunks
    assert chunk.flags == motion_pb2.CHUNK_FLAG_FIRST
    assert (chunk.waypoint, chunk.candidates) == (5, 4)
    assert chunk.scheduled_at_us == round(sent.scheduled_at * 1e6)
    translation, rotations, contacts = codec.decode(chunk.poses, chunk.contacts, Basis.ROS)
    np.testing.assert_allclose(translation, sent.translation, atol=1e-6)
    np.testing.assert_array_equal(rotations, sent.rotations)
    np.testing.assert_array_equal(contacts, sent.contacts)

    listed = await rig.agents.ListAgents(agent_pb2.ListAgentsRequest(session_id=session_id))
    assert [a.agent_id for a in listed.agents] == [agent.agent_id]
    got = await rig.agents.GetAgent(agent_pb2.GetAgentRequest(agent_id=agent.agent_id))
    assert got.agent == listed.agents[0]
    await rig.goals.ClearGoal(goal_pb2.ClearGoalRequest(agent_id=agent.agent_id))
    await rig.agents.DeleteAgent(agent_pb2.DeleteAgentRequest(agent_id=agent.agent_id))
    await rig.sessions.DeleteSession(session_pb2.DeleteSessionRequest(session_id=session_id))
    while (message := await call.read()) is not grpc.aio.EOF:
        assert not message.batch.chunks
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


async def test_a_goal_of_a_path_that_is_wrong_is_named(rig):
    _, (agent, _) = await rig.session()
    goals = [{"position": {}}, {"position": {}, "heading": float("nan")}]
    request = goal_pb2.SetPathRequest(agent_id=agent["agent_id"], goals=goals)
    with pytest.raises(grpc.aio.AioRpcError, match=r"goals\[1\]\.heading") as caught:
        await rig.goals.SetPath(request)
    assert caught.value.code() == grpc.StatusCode.INVALID_ARGUMENT
    assert rig.service.goals == []


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
