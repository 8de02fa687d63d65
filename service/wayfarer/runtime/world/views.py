"""What is told of slots: rows of arrays as the plain messages of agent.py."""

from typing import Final, NamedTuple

import numpy as np

from wayfarer.runtime.agent import STATES, AgentInfo, MotionChunks
from wayfarer.runtime.engines.models import Models
from wayfarer.runtime.stepping.playback import Sent
from wayfarer.runtime.stepping.timeline import Timeline
from wayfarer.runtime.world.heading import heading_of
from wayfarer.runtime.world.registry import Agent
from wayfarer.runtime.world.slots import Mode, Slots
from wayfarer.spec import NEW_FRAMES

STATE_OF_MODE: Final = np.array([STATES.index(mode.state) for mode in Mode], np.int8)
"""Index into `STATES`."""


def agent_info(agent: Agent, slots: Slots, models: Models) -> AgentInfo:
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


class Due(NamedTuple):
    """What of a session leaves now."""

    session_id: str
    chunks: MotionChunks  # one of an agent at most


def due_by_session(
    sent: Sent, slots: Slots, by_slot: dict[int, Agent], timeline: Timeline
) -> list[Due]:
    """Chunks that have just left, in their order within each session.

    Arrays are of their own: who keeps a session's must not keep those of all the others.
    """
    session = slots.session[sent.slots]
    chunks = _columns(sent, slots, timeline)
    if (session == session[0]).all():
        return [Due(by_slot[int(sent.slots[0])].session_id, chunks)]
    order = np.argsort(session, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(session[order])) + 1)
    return [Due(by_slot[int(sent.slots[part[0]])].session_id, chunks.take(part)) for part in parts]


def _columns(sent: Sent, slots: Slots, timeline: Timeline) -> MotionChunks:
    chunks, gait = sent.chunks, sent.chunks.end.gait
    return MotionChunks(
        agent_id=slots.agent_id[sent.slots],
        alias=slots.alias[sent.slots],
        seq=sent.seq,
        first_frame=sent.seq * NEW_FRAMES,
        scheduled_at=timeline.times(sent.frame),
        goal_revision=chunks.goal_revision,
        flags=chunks.flags,
        state=STATE_OF_MODE[gait.mode],
        translation=chunks.translation,
        rotations=chunks.rotations,
        contacts=chunks.contacts,
        waypoint=gait.waypoint,
        candidates=chunks.candidates,
    )
