"""Chunks that are due, as columns by session."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from wayfarer.spec import NEW_FRAMES
from wayfarer.world.agents.agent import STATES, MotionChunks
from wayfarer.world.agents.behaviour import Agent
from wayfarer.world.agents.slots import Mode, Slots
from wayfarer.world.agents.timeline import Timeline
from wayfarer.world.rows import Index, Int8
from wayfarer.world.stepping.playback import Sent

STATE_OF_MODE: Final = np.array([STATES.index(mode.state) for mode in Mode], np.int8)
"""Index into `STATES`."""


class Due(NamedTuple):
    """The chunks of a session that leave now."""

    session_id: str
    chunks: MotionChunks  # at most one per agent
    slots: Index  # of their agents


def sights_of(due: Sequence[Due], slots: Slots) -> Int8:
    """How well the agents of these chunks are seen [A]; see `Sight`."""
    return slots.sight[np.concatenate([one.slots for one in due])] if due else np.zeros(0, np.int8)


def due_by_session(
    sent: Sent, slots: Slots, by_slot: dict[int, Agent], timeline: Timeline
) -> list[Due]:
    """Chunks that have just left, in their order within each session: parts of the same arrays."""
    chunks, rows = _columns(sent, slots, timeline), sent.slots
    ends = np.flatnonzero(np.diff(slots.session[rows], append=-1)) + 1
    return [
        Due(by_slot[int(rows[first])].session_id, chunks.part(first, last), rows[first:last])
        for first, last in zip([0, *ends[:-1]], ends.tolist(), strict=True)
    ]


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
