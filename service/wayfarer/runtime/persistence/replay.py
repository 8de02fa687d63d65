"""A command log played again: the same poses, bit for bit, on the same model and engine.

Every agent walks in a separate small world, stepped chunk by chunk with as many candidates as
were tried then; commands are given right before the chunk that they first counted for.
"""

import heapq
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import accumulate
from typing import Final

from wayfarer.errors import FailedPrecondition
from wayfarer.runtime.persistence.record import AgentTrack, ChunkRun, CommandLog, LogEntry
from wayfarer.runtime.streams.publications import Publication
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import (
    AgentChange,
    AgentInfo,
    AgentSpec,
    ChunkFlag,
    MotionChunk,
    MotionChunks,
    SessionSpec,
)
from wayfarer.world.goals.commands import GoalCommand
from wayfarer.world.observer import Start
from wayfarer.world.stepping.budget import DegradationLevel
from wayfarer.world.world import World

SESSION: Final = "replay"
TOGETHER: Final = 1e-3
"""Seconds: chunks due within this are published together."""


def replay(log: CommandLog, make_world: Callable[[], World]) -> Iterator[Publication]:
    """The session's publications, without its events; `make_world` makes one for each agent.

    Its chunks have the ids, numbers and times they had. Raises FailedPrecondition when they do not
    come about as the log has it, and InvalidArgument when a command of it is malformed.
    """
    tracks = [_play(log.session_id, track, make_world) for track in log.tracks.values()]
    played = heapq.merge(*tracks, key=lambda both: (both[0].scheduled_at, both[0].alias))
    for position, group in enumerate(_together(played), start=1):
        added = tuple(info for _, info in group if info is not None)
        yield Publication(position, MotionChunks.of([chunk for chunk, _ in group]), added=added)


Played = tuple[MotionChunk, AgentInfo | None]
"""A chunk, and who it is of if it is that agent's first."""


def _play(session_id: str, track: AgentTrack, make_world: Callable[[], World]) -> Iterator[Played]:
    world = make_world()
    info = _enter(world, track.start)
    introduced: AgentInfo | None = replace(
        info,
        agent_id=track.agent_id,
        alias=track.alias,
        session_id=session_id,
        created_at=track.created_at,
    )
    for chunk in _chunks(world, info.agent_id, track):
        yield chunk, introduced
        introduced = None


def _enter(world: World, start: Start) -> AgentInfo:
    world.create_session(SessionSpec(SESSION), 0.0)
    if isinstance(start, AgentSpec):
        [info] = world.create_agents(SESSION, [start], 0.0)
        return info
    return world.get_agent(world.members.put_agent(SESSION, start, 0.0).agent_id)


def _chunks(world: World, agent_id: str, track: AgentTrack) -> Iterator[MotionChunk]:
    orders, changes = _orders(track.entries), _changes(track.entries)
    for seq in range(track.first, track.end):
        now = world.next_event()
        assert now is not None  # there is an agent
        while orders and orders[0][0] <= seq:
            world.give(agent_id, orders.popleft()[1], now)
        while changes and changes[0][0] <= seq:
            world.update_agent(agent_id, changes.popleft()[1])
        run = _at(track.runs, seq)
        world.use_model(world.models.stamped(run.model).name)
        yield _as_it_was(_step(world, run, now), track)


def _as_it_was(chunk: MotionChunk, track: AgentTrack) -> MotionChunk:
    replanned = _at(track.runs, chunk.seq).replanned
    return replace(
        chunk,
        agent_id=track.agent_id,
        alias=track.alias,
        scheduled_at=_time(track, chunk.seq),
        flags=chunk.flags | (ChunkFlag.REPLANNED if replanned else ChunkFlag.NONE),
    )


def _step(world: World, run: ChunkRun, now: float) -> MotionChunk:
    """Plans the next chunk and sends it: each planned chunk is sent before the next is planned."""
    world.step(now, DegradationLevel(max(run.candidates, 1), hold_idle=run.candidates == 0))
    chunks = world.collect(now + world.settings.lead * STEP_SECONDS)
    if len(chunks) != 1 or chunks[0].candidates != run.candidates:
        raise FailedPrecondition(
            f"the log has chunk {run.first} tried with {run.candidates} candidates, and here it "
            "comes about otherwise: it is of another model or version, or has been altered"
        )
    return chunks[0]


def _orders(entries: list[LogEntry]) -> deque[tuple[int, GoalCommand]]:
    """Orders, each with the chunk by which it had been given in any case.

    A later order may have thrown away the chunk that an earlier one first counted for.
    """
    orders = [(e.seq, e.command) for e in entries if not isinstance(e.command, AgentChange)]
    earliest = list(accumulate((seq for seq, _ in reversed(orders)), min))[::-1]
    return deque((seq, order) for seq, (_, order) in zip(earliest, orders, strict=True))


def _changes(entries: list[LogEntry]) -> deque[tuple[int, AgentChange]]:
    return deque((e.seq, e.command) for e in entries if isinstance(e.command, AgentChange))


def _at(runs: list[ChunkRun], seq: int) -> ChunkRun:
    return runs[bisect_right(runs, seq, key=lambda run: run.first) - 1]


def _time(track: AgentTrack, seq: int) -> float:
    place = bisect_right(track.schedules, seq, key=lambda schedule: schedule.first) - 1
    return track.schedules[place].time(seq)


def _together(played: Iterator[Played]) -> Iterator[list[Played]]:
    """Groups of chunks that were due together, at most one of each agent."""
    group: list[Played] = []
    for chunk, info in played:
        own = {other.alias for other, _ in group}
        due = group and chunk.scheduled_at - group[0][0].scheduled_at <= TOGETHER
        if group and (not due or chunk.alias in own):
            yield group
            group = []
        group.append((chunk, info))
    if group:
        yield group
