"""Every goal verb arrives by gRPC, HTTP and Control as the same command, and is refused alike."""

import grpc
import pytest

from wayfarer.errors import InvalidArgument
from wayfarer.v1 import control_pb2, goal_pb2
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import Follow, Wander
from wayfarer.world.goals.commands import Append, Path, Stop

# one unit along the wire's z is one unit along +Y of the world
AHEAD = {"position": {"x": 0.0, "y": 0.0, "z": 4.0}}
TURNED = {**AHEAD, "radius": 0.5, "speed": 1.5, "heading": 0.5, "strafe": True, "dwell": 2.0}
GOAL = Goal((0.0, 4.0, 0.0))
GOAL_TURNED = Goal((0.0, 4.0, 0.0), 0.5, 1.5, heading=0.5, strafe=True, dwell=2.0)
THROUGH = Goal((0.0, 4.0, 0.0), stop=False)
GOALS = {"goals": [{**AHEAD, "stop": False}, TURNED]}
AREA = {"area": {"center": {"x": 0.0, "y": 0.0, "z": 1.0}, "radius": 3.0}, "dwell": 2.0}
FOLLOW = {"follow": {"agent_id": "another", "behind": 1.5}}
VERBS = [
    ("SetGoal", "set_goal", "PUT", "goal", TURNED, GOAL_TURNED),
    ("SetPath", "set_path", "PUT", "path", GOALS, Path((THROUGH, GOAL_TURNED))),
    ("AppendGoals", "append_goals", "POST", "goals", GOALS, Append((THROUGH, GOAL_TURNED))),
    ("Wander", "wander", "PUT", "wander", AREA, Wander((0.0, 1.0), 3.0, dwell=2.0)),
    ("Behave", "behave", "PUT", "behaviour", FOLLOW, Follow("another", 1.5)),
    ("ClearGoal", "clear_goal", "DELETE", "goal", None, Stop()),
]
INSIDE = {"SetGoal": "goal", "Behave": "behaviour"}  # the body is a field of the request
WRONG = {
    "SetGoal": ({**AHEAD, "dwell": -1.0}, "dwell"),
    "SetPath": ({"goals": [AHEAD, {**AHEAD, "dwell": -1.0}]}, "goals[1].dwell"),
    "AppendGoals": ({"goals": []}, "goals"),
    "Wander": ({**AREA, "dwell": -2.0}, "dwell"),
    "Behave": ({"routine": {"parts": []}}, "routine.parts"),
}


def request_of(rpc: str, agent_id: str, body: dict | None, expected: int | None = None):
    fields = {INSIDE[rpc]: body} if rpc in INSIDE else body or {}
    request = getattr(goal_pb2, f"{rpc}Request")(agent_id=agent_id, **fields)
    if expected is not None:
        request.expected_revision = expected
    return request


@pytest.mark.parametrize(("rpc", "command", "method", "path", "body", "meant"), VERBS)
async def test_a_verb_arrives(rig, rpc, command, method, path, body, meant):
    session_id, (agent, _) = await rig.session()
    agent_id = agent["agent_id"]
    given = await getattr(rig.goals, rpc)(request_of(rpc, agent_id, body, expected=0))
    assert given.revision == 1
    url = f"/v1/agents/{agent_id}/{path}"
    answer = await rig.http.request(method, url, json=body, params={"expected_revision": 1})
    assert answer.json() == {"revision": 2}
    call = rig.control.Control()
    await call.write(control_pb2.ControlRequest(open={"session_id": session_id}))
    await call.read()
    sent = {command: request_of(rpc, agent_id, body, expected=2)}
    await call.write(control_pb2.ControlRequest(command_id=7, **sent))
    assert (await call.read()).reply == control_pb2.CommandReply(command_id=7, revision=3)
    call.cancel()
    assert rig.service.commands == [(agent_id, meant)] * 3
    assert rig.service.expected == [0, 1, 2]


@pytest.mark.parametrize(("rpc", "command", "method", "path", "body", "meant"), VERBS)
async def test_a_verb_is_refused(rig, rpc, command, method, path, body, meant):
    _, (agent, _) = await rig.session()
    cases = [(agent["agent_id"], body, 9, "ABORTED", 409), ("none", body, None, "NOT_FOUND", 404)]
    if rpc in WRONG:
        cases.append((agent["agent_id"], WRONG[rpc][0], None, "INVALID_ARGUMENT", 422))
    for agent_id, sent, expected, code, status in cases:
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await getattr(rig.goals, rpc)(request_of(rpc, agent_id, sent, expected))
        assert caught.value.code().name == code
        url = f"/v1/agents/{agent_id}/{path}"
        query = {} if expected is None else {"expected_revision": expected}
        answer = await rig.http.request(method, url, json=sent, params=query)
        assert answer.status_code == status
        if status == 422:
            assert answer.json()["errors"][0]["field"] == WRONG[rpc][1]
            assert WRONG[rpc][1] in caught.value.details()
    assert rig.service.commands == []


@pytest.mark.parametrize(
    ("rpc", "path", "body", "fault", "on_grpc", "on_http"),
    [
        ("SetGoal", "goal", AHEAD, "goal.speed", "goal.speed", "speed"),
        ("SetPath", "path", GOALS, "goals[0].speed", "goals[0].speed", "goals[0].speed"),
        ("Wander", "wander", AREA, "behaviour.radius", "area.radius", "area.radius"),
        (
            *("Behave", "behaviour", FOLLOW, "behaviour.agent_id"),
            *("behaviour.follow.agent_id", "follow.agent_id"),
        ),
    ],
)
async def test_the_field_at_fault_is_named_as_it_was_sent(
    rig, monkeypatch, rpc, path, body, fault, on_grpc, on_http
):
    async def refuse(*_):
        raise InvalidArgument("{} is {}", fault, fault, 9)

    _, (agent, _) = await rig.session()
    monkeypatch.setattr(rig.service, "give", refuse)
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await getattr(rig.goals, rpc)(request_of(rpc, agent["agent_id"], body))
    assert caught.value.details() == f"{on_grpc} is 9"
    answer = await rig.http.put(f"/v1/agents/{agent['agent_id']}/{path}", json=body)
    assert answer.json()["errors"] == [{"field": on_http, "detail": f"{on_http} is 9"}]
    assert answer.json()["detail"] == f"{on_http} is 9"
