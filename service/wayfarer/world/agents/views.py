"""The slots' state of agents as plain messages of agent.py."""

import numpy as np

from wayfarer.engines.models import LoadedModels
from wayfarer.spec import GENDERS
from wayfarer.world.agents.agent import AgentInfo, AgentState, Sight, by_sight
from wayfarer.world.agents.behaviour import Agent
from wayfarer.world.agents.heading import heading_of
from wayfarer.world.agents.slots import Mode, Slots


def agent_info(agent: Agent, slots: Slots, models: LoadedModels) -> AgentInfo:
    """A snapshot: the motion as far as it has been sent, the path as far as it is planned."""
    slot = agent.slot
    seed, waypoint = slots.committed.seed, int(slots.planned.gait.waypoint[slot])
    x, y, z = (float(v) for v in seed.translation[slot, -1])
    return AgentInfo(
        agent_id=agent.agent_id,
        alias=agent.alias,
        session_id=agent.session_id,
        spec=agent.spec,
        state=Mode(int(slots.committed.gait.mode[slot])).state,
        position=(x, y, z + float(slots.footing.hips[slot])),
        heading=heading_of(seed.rotations[slot, -1, 0]),
        goal=agent.path[waypoint - agent.passed] if agent.path else None,
        goal_revision=int(slots.goal_revision[slot]),
        created_at=agent.created_at,
        waypoint=waypoint,
        waypoints=agent.passed + len(agent.path) if agent.path else 0,
        model=models.numbered(int(slots.model[slot])).name,
    )


def agents_by_state(slots: Slots) -> dict[AgentState, int]:
    """Number of agents in each state, as of the sent motion."""
    counts = np.bincount(slots.committed.gait.mode[slots.active], minlength=len(Mode))
    states = dict.fromkeys(AgentState, 0)
    for mode in Mode:
        states[mode.state] += int(counts[mode])
    return states


def distant_by_gender(slots: Slots) -> list[int]:
    """Number of agents of each gender that are seen at most as a root."""
    distant = slots.active & (slots.sight >= Sight.ROOT)
    return np.bincount(slots.gender[distant], minlength=len(GENDERS)).tolist()


def agents_by_sight(slots: Slots) -> dict[str, int]:
    """Number of agents by sight, as of the sent motion; see `by_sight`."""
    return by_sight(np.bincount(slots.sight[slots.active], minlength=len(Sight)))
