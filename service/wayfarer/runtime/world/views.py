"""What is told of slots: rows of arrays as the plain messages of agent.py."""

from collections.abc import Callable, Iterator

from wayfarer.runtime.agent import AgentInfo, AgentState, ChunkFlag, MotionChunk
from wayfarer.runtime.engines.models import Models
from wayfarer.runtime.stepping.playback import Sent
from wayfarer.runtime.world.heading import heading_of
from wayfarer.runtime.world.registry import Agent
from wayfarer.runtime.world.slots import Mode, Slots
from wayfarer.spec import NEW_FRAMES

STATES: tuple[AgentState, ...] = tuple(mode.state for mode in Mode)


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
        state=STATES[slots.committed.gait.mode[slot]],
        position=(x, y, z),
        heading=heading_of(seed.rotations[slot, -1, 0]),
        goal=agent.path[waypoint - agent.passed] if agent.path else None,
        goal_revision=int(slots.goal_revision[slot]),
        created_at=agent.created_at,
        waypoint=waypoint,
        waypoints=agent.passed + len(agent.path) if agent.path else 0,
        model=models.numbered(int(slots.model[slot])).name,
    )


def motion_chunks(
    sent: Sent, by_slot: dict[int, Agent], time: Callable[[int], float]
) -> Iterator[MotionChunk]:
    """One message for each row; `time` gives the moment at which a world frame is shown.

    Arrays are copies: a chunk that somebody keeps must not keep those of all the others.
    """
    chunks = sent.chunks
    for row, (slot, seq, frame) in enumerate(
        zip(sent.slots.tolist(), sent.seq.tolist(), sent.frame.tolist(), strict=True)
    ):
        agent = by_slot[slot]
        yield MotionChunk(
            agent_id=agent.agent_id,
            alias=agent.alias,
            seq=seq,
            first_frame=seq * NEW_FRAMES,
            scheduled_at=time(frame),
            goal_revision=int(chunks.goal_revision[row]),
            flags=ChunkFlag(int(chunks.flags[row])),
            state=STATES[chunks.end.gait.mode[row]],
            translation=chunks.translation[row].copy(),
            rotations=chunks.rotations[row].copy(),
            contacts=chunks.contacts[row].copy(),
            waypoint=int(chunks.end.gait.waypoint[row]),
            candidates=int(chunks.candidates[row]),
        )
