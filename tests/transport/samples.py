"""Samples of a runtime's values: an agent, a chunk, a model."""

import numpy as np

from wayfarer.engines.models import ModelInfo
from wayfarer.spec import NEW_FRAMES, POSED_JOINTS
from wayfarer.world.agents.agent import AgentInfo, AgentSpec, AgentState, ChunkFlag, MotionChunk

NOW = 1_700_000_000.0
MODEL = ModelInfo("fake", ("female", "male"), 2, 10, ("0", "1"), in_use=True)


def agent_info(agent_id: str, alias: int, session_id: str, spec: AgentSpec) -> AgentInfo:
    return AgentInfo(
        agent_id=agent_id,
        alias=alias,
        session_id=session_id,
        spec=spec,
        state=AgentState.STANDING,
        position=(*spec.position, 0.9),
        heading=spec.heading,
        goal=None,
        goal_revision=0,
        created_at=NOW,
        model="fake",
    )


def chunk(
    agent_id: str = "agent-1",
    alias: int = 1,
    seq: int = 0,
    hips: tuple[float, float, float] = (1.0, 2.0, 0.9),
) -> MotionChunk:
    """Frames in which the hips move along +Y and turn about +Z, 0.1 per frame."""
    step = np.arange(NEW_FRAMES) * 0.1
    translation = np.array(hips, np.float32) + np.outer(step, [0, 1, 0]).astype(np.float32)
    rotations = np.zeros((NEW_FRAMES, POSED_JOINTS, 4), np.float32)
    rotations[..., 3] = 1.0
    rotations[:, 0, 2], rotations[:, 0, 3] = np.sin(step / 2), np.cos(step / 2)
    contacts = np.zeros((NEW_FRAMES, 2), bool)
    contacts[::2, 0] = contacts[1::2, 1] = True
    return MotionChunk(
        agent_id=agent_id,
        alias=alias,
        seq=seq,
        first_frame=seq * NEW_FRAMES,
        scheduled_at=NOW + seq * 0.2,
        goal_revision=0,
        flags=ChunkFlag.FIRST if seq == 0 else ChunkFlag.NONE,
        state=AgentState.STANDING,
        translation=translation.astype(np.float32),
        rotations=rotations,
        contacts=contacts,
        waypoint=5,
        candidates=4,
    )
