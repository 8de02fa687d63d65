"""The largest possible requests, wrong everywhere, get a short answer quickly.

Each of these once took the event loop minutes, found by `benchmarks.fuzz`.
"""

import json

import pytest
from pydantic import ValidationError

from wayfarer.errors import InvalidArgument
from wayfarer.transport import schema
from wayfarer.transport.conversion import wire
from wayfarer.transport.conversion.violations import invalid_request
from wayfarer.transport.errors import InvalidRequest
from wayfarer.v1 import agent_pb2, goal_pb2, motion_pb2

EMPTY, BAD = goal_pb2.Goal(), goal_pb2.Goal(radius=float("nan"), speed=-1.0)


@pytest.mark.parametrize(
    ("twin", "message", "field"),
    [
        (schema.Goals, goal_pb2.SetPathRequest(goals=[EMPTY] * 250_000), "goals"),
        (schema.NewAgents, agent_pb2.CreateAgentsRequest(agents=[{}] * 250_000), "agents"),
        (
            schema.NewAgents,
            agent_pb2.CreateAgentsRequest(agents=[agent_pb2.AgentSpec(betas=[9.0] * 100_000)]),
            "agents[0].betas",
        ),
        (
            schema.StreamRequest,
            motion_pb2.StreamMotionRequest(agent_ids=[""] * 250_000),
            "agent_ids",
        ),
    ],
)
def test_lists_that_no_schema_allows_are_not_looked_into(twin, message, field):
    with pytest.raises(InvalidArgument, match=f"allowed: {wire.MAX_ITEMS}") as caught:
        wire.parse(twin, message)
    assert caught.value.field == field


def test_the_first_wrong_item_of_a_list_is_told_and_all_that_is_wrong_with_it():
    request = goal_pb2.SetPathRequest(goals=[BAD] * 1024)
    with pytest.raises(InvalidRequest) as caught:
        wire.parse(schema.Goals, request)
    fields = [field for field, _ in caught.value.violations]
    assert fields == ["goals[0].position", "goals[0].radius"]  # the world judges how fast


def test_so_it_is_in_json():
    body = json.dumps({"goals": [{"speed": -1}] * 100_000})
    with pytest.raises(ValidationError) as caught:
        schema.Goals.model_validate_json(body)
    fields = [field for field, _ in invalid_request(caught.value).violations]
    assert fields == ["goals[0].position"]
