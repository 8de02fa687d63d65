"""One agent's motion from its goals, as fast as it can be made, for a clip."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from wayfarer.errors import InvalidArgument
from wayfarer.runtime.streams.publications import Publication
from wayfarer.spec import FPS, STEP_SECONDS
from wayfarer.world.agents.agent import (
    AgentSpec,
    AgentState,
    ChunkFlag,
    MotionChunk,
    MotionChunks,
    SessionSpec,
)
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.commands import Path
from wayfarer.world.world import World


def walk(
    world: World, spec: AgentSpec, goals: Sequence[Goal], seconds: float, until_arrival: bool
) -> Iterator[Publication]:
    """Yields its chunks one by one, for exactly `seconds`; times count from 0.

    `until_arrival`: or until it stands at the last goal, if that is sooner. The world is left as it
    was. Raises InvalidArgument on a bad spec, goal or length.
    """
    left = round(seconds * FPS)
    if left < 1:
        raise InvalidArgument(f"seconds is {seconds:g}; at least one frame is needed", "seconds")
    session_id = world.create_session(SessionSpec(), now=0.0).session_id
    try:
        [info] = world.create_agents(session_id, [spec], now=0.0)
        if goals:
            world.give(info.agent_id, Path(tuple(goals)), now=0.0)
        has_arrived = False
        for chunk in _chunks(world, info.agent_id):
            frames = min(left, len(chunk.translation))
            left -= frames
            added = (info,) if chunk.seq == 0 else ()
            yield Publication(chunk.seq + 1, MotionChunks.of([_cut(chunk, frames)]), added=added)
            is_last = chunk.waypoint == len(goals) - 1
            has_arrived |= is_last and bool(chunk.flags & ChunkFlag.ARRIVED)
            if not left or (until_arrival and has_arrived and chunk.state is AgentState.STANDING):
                return
    finally:
        world.delete_session(session_id)


def _chunks(world: World, agent_id: str) -> Iterator[MotionChunk]:
    while (event := world.next_event()) is not None:
        yield from (chunk for chunk in world.tick(event) if chunk.agent_id == agent_id)


def _cut(chunk: MotionChunk, frames: int) -> MotionChunk:
    return replace(
        chunk,
        scheduled_at=chunk.seq * STEP_SECONDS,
        translation=chunk.translation[:frames],
        rotations=chunk.rotations[:frames],
        contacts=chunk.contacts[:frames],
    )
