"""The event of an agent that another model moves from now on."""

from wayfarer.world.agents.agent import AgentInfo
from wayfarer.world.events import Event, EventKind


def model_changed(agent: AgentInfo, at: float) -> Event:
    """An agent is moved by another model, of which it knows already; Unix seconds."""
    return Event(
        EventKind.MODEL_CHANGED,
        at,
        agent_id=agent.agent_id,
        alias=agent.alias,
        goal_revision=agent.goal_revision,
        waypoint=agent.waypoint,
        detail=f"model {agent.model!r} moves the agent from its next primitive on",
    )
