"""Routes of AgentService and GoalService."""

from fastapi import APIRouter

from wayfarer.transport import schema
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.http_server.parameters import AgentId, Expected, fields_of


def agent_routes(gateway: Gateway) -> APIRouter:
    """`/v1/agents`."""
    router = APIRouter(prefix="/v1/agents", tags=["agents"])

    @router.get("/{agent_id}", operation_id="getAgent", summary="Describe an agent")
    async def get_agent(agent_id: AgentId) -> schema.Agent:
        return await gateway.agents.get(agent_id)

    @router.patch("/{agent_id}", operation_id="updateAgent", summary="Change an agent")
    async def update_agent(agent_id: AgentId, request: schema.AgentUpdate) -> schema.Agent:
        """What is absent stays."""
        return await gateway.agents.update(agent_id, request)

    @router.delete(
        "/{agent_id}", status_code=204, operation_id="deleteAgent", summary="Remove an agent"
    )
    async def delete_agent(agent_id: AgentId) -> None:
        """Its streams report the removal."""
        await gateway.agents.delete(agent_id)

    return router


def goal_routes(gateway: Gateway) -> APIRouter:
    """Below `/v1/agents/{agent_id}`."""
    router = APIRouter(prefix="/v1/agents/{agent_id}", tags=["goals"])
    goals = gateway.goals

    @router.put("/goal", operation_id="setGoal", summary="Give an agent a goal")
    async def set_goal(
        agent_id: AgentId, goal: schema.Goal, expected_revision: Expected = None
    ) -> schema.GoalRevision:
        """The goal replaces its present goal or path and takes effect within one step (0.2 s)."""
        with fields_of("goal"):
            return _revision(await goals.give(agent_id, goal, expected_revision))

    @router.put("/path", operation_id="setPath", summary="Give an agent goals to visit in turn")
    async def set_path(
        agent_id: AgentId, path: schema.Goals, expected_revision: Expected = None
    ) -> schema.GoalRevision:
        """The path replaces its present goal or path; it is one revision."""
        return _revision(await goals.give(agent_id, path, expected_revision))

    @router.post("/goals", operation_id="appendGoals", summary="Add goals to the end of the path")
    async def append_goals(
        agent_id: AgentId, more: schema.Goals, expected_revision: Expected = None
    ) -> schema.GoalRevision:
        """The agent keeps its present goal and what is planned for it."""
        return _revision(await goals.give(agent_id, more, expected_revision, append=True))

    @router.put("/wander", operation_id="wander", summary="Let an agent walk about")
    async def wander(
        agent_id: AgentId, request: schema.Wander, expected_revision: Expected = None
    ) -> schema.GoalRevision:
        """It walks in an area, or all over its scene, from one random place to the next."""
        return _revision(await goals.give(agent_id, request, expected_revision))

    @router.put("/behaviour", operation_id="behave", summary="Give an agent a behaviour")
    async def behave(
        agent_id: AgentId, request: schema.Behaviour, expected_revision: Expected = None
    ) -> schema.GoalRevision:
        """Patrol, follow, keep away, queue, or a routine of these, until the next goal command."""
        with fields_of("behaviour"):
            return _revision(await goals.give(agent_id, request, expected_revision))

    @router.delete("/goal", operation_id="clearGoal", summary="Remove the goal or path")
    async def clear_goal(
        agent_id: AgentId, expected_revision: Expected = None
    ) -> schema.GoalRevision:
        """The agent stops where it is."""
        return _revision(await goals.give(agent_id, None, expected_revision))

    return router


def _revision(number: int) -> schema.GoalRevision:
    return schema.GoalRevision(revision=number)
