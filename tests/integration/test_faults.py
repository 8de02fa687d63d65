"""Failures that operators fear, in the real process with the shipped model; nothing is lost."""

import asyncio
import math
import signal
import time

import numpy as np

import wayfarer_client as wf
from tests.serving import Service

PEOPLE = 64
SPEED = 2.5
"""m/s that no agent exceeds at a target of 1.2."""


def crowd() -> list[wf.AgentSpec]:
    """People on a grid, 2 m apart."""
    return [
        wf.AgentSpec(
            gender=("female", "male")[i % 2], position=(2.0 * (i % 8), 0.0, 2.0 * (i // 8)), seed=i
        )
        for i in range(PEOPLE)
    ]


async def watch(stream: wf.MotionStream, seconds: float) -> dict[str, wf.Frames]:
    """The last frames of each agent after `seconds`."""
    last: dict[str, wf.Frames] = {}
    until = time.monotonic() + seconds
    async for batch in stream:
        last |= {frames.agent.agent_id: frames for frames in batch}
        if time.monotonic() > until:
            break
    return last


def place(frames: wf.Frames, index: int = -1) -> np.ndarray:
    """Hips on the ground."""
    return frames.translation[index][[0, 2]]


async def test_after_a_kill_all_stand_where_they_stood_and_walk_on(tmp_path):
    state = ("--state-dir", str(tmp_path))
    with Service(*state) as service:
        async with wf.Client(service.grpc_address) as client:
            session = await client.create_session(lease=600)
            people = await session.create_agents(*crowd())
            for agent in people:
                await session.set_goal(agent, (7.0, 0.0, 40.0))
            stream = session.stream()
            before = await watch(stream, 4.0)
            token = stream.resume_token
            await stream.aclose()
        service.process.send_signal(signal.SIGKILL)
        service.process.wait()
    with Service(*state) as service:
        async with wf.Client(service.grpc_address) as client:
            session = await client.session(session.session_id)
            stream = session.stream(resume_token=token)
            events, first = [], {}
            async with asyncio.timeout(20):
                async for batch in stream:
                    events += batch.events
                    for frames in batch:
                        first.setdefault(frames.agent.agent_id, frames)
                    if len(first) == PEOPLE:
                        break
            later = await watch(stream, 2.0)
            await stream.aclose()
            revisions = {agent.goal_revision for agent in await session.agents()}
    assert set(before) == set(first) == {agent.agent_id for agent in people}
    assert [event.kind for event in events] == ["gap"]
    jumps = [math.dist(place(before[a]), place(first[a], 0)) for a in before]
    assert max(jumps) < SPEED * 1.0, "within one second of motion"
    ways = [math.dist(place(first[a]), place(later[a])) for a in before]
    assert np.median(ways) > 0.3, "they walk on to their goals"
    assert revisions == {1}
