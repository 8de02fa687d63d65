"""The runtime whole: snapshots between servers, logs, clips, restarts."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.kept_worlds import assert_same_poses, fake_worlds, open_journal
from tests.runtime.test_lockstep import until_ready
from tests.world.fakes import people
from wayfarer.config.limits import Limits
from wayfarer.errors import (
    AlreadyExists,
    ArtifactError,
    FailedPrecondition,
    InvalidArgument,
    NotFound,
)
from wayfarer.runtime import motion_service
from wayfarer.runtime.motion_service import MotionService
from wayfarer.runtime.streams.publications import StreamOptions
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.commands import Path

RECORDED = SessionSpec("s", record=True, attributes={"basis": "unity", "owner": "ada"})
FAR = Goal((0.0, 90.0, 0.0))


async def chunks_of(runtime, seconds, session="s"):
    subscription = await runtime.subscribe(session, StreamOptions())
    found = []

    async def read():
        async for published in subscription:
            found.extend(published.chunks)

    reader = asyncio.create_task(read())
    await asyncio.sleep(seconds)
    reader.cancel()
    await asyncio.gather(reader, return_exceptions=True)
    await subscription.close()
    return found


async def walking(runtime, spec=RECORDED, count=3):
    await runtime.create_session(spec)
    agents = await runtime.create_agents("s", people(count))
    for agent in agents:
        x, y = agent.spec.position
        await runtime.give(agent.agent_id, replace(FAR, position=(x, y + 90.0, 0.0)))
    return agents


async def test_a_snapshot_is_no_second_session(servers):
    here = await servers.start()
    await walking(here)
    snapshot = await here.export_session("s")
    with pytest.raises(AlreadyExists):
        await here.import_session(snapshot)
    with pytest.raises(NotFound):
        await here.export_session("nowhere")
    with pytest.raises(InvalidArgument):
        await here.import_session(snapshot[:-20])
    await here.delete_session("s")
    assert len((await here.import_session(snapshot)).agent_ids) == 3


async def test_a_lock_step_session_moves_as_well(servers):
    here, there = await servers.start(), await servers.start()
    await walking(here, replace(RECORDED, lock_step=True))
    await here.step_session("s", 7)
    await there.import_session(await here.export_session("s"))
    a, b = await here.step_session("s", 5), await there.step_session("s", 5)
    for mine, theirs in zip(a, b, strict=True):
        for x, y in zip(mine.chunks, theirs.chunks, strict=True):
            assert_same_poses(y, x)


async def test_what_was_not_recorded_has_no_log(servers):
    here = await servers.start()
    await here.create_session(SessionSpec("s"))
    with pytest.raises(FailedPrecondition, match="record"):
        await here.export_log("s")


async def test_a_clip_is_the_motion_that_a_session_would_have(servers):
    here = await servers.start()
    [spec] = people(1)
    clip = [p async for p in here.generate_clip(spec, [Goal((0.0, 3.0, 0.0))], 4.0, False)]
    await here.create_session(SessionSpec("s", lock_step=True))
    [agent] = await here.create_agents("s", [spec])
    await here.give(agent.agent_id, Path((Goal((0.0, 3.0, 0.0)),)))
    for a, b in zip(clip, await here.step_session("s", 20), strict=True):
        np.testing.assert_array_equal(a.chunks[0].rotations, b.chunks[0].rotations)
        np.testing.assert_array_equal(a.chunks[0].translation, b.chunks[0].translation)
    with pytest.raises(InvalidArgument):
        await anext(here.generate_clip(spec, [], -1.0, False))


async def test_a_server_goes_on_where_the_last_one_stopped(servers, tmp_path):
    first = await servers.start(open_journal(tmp_path))
    agents = await walking(first)
    await first.create_session(SessionSpec("tool", lock_step=True))
    await first.create_agents("tool", people(2))
    await first.step_session("tool", 3)
    async with asyncio.timeout(30):  # people set off when they are ready
        while min(a.position[1] for a in await first.list_agents("s")) < 0.5:
            await asyncio.sleep(0.1)
    assert not (await first.stats()).journal_failing
    await servers.stop(first)

    second = await servers.start(open_journal(tmp_path))
    sessions = await second.list_sessions()
    assert [s.session_id for s in sessions] == ["s", "tool"]
    assert sessions[0].spec == RECORDED and sessions[1].spec.lock_step
    found = await second.list_agents("s")
    assert [a.agent_id for a in found] == [a.agent_id for a in agents]
    assert all(a.position[1] > 0.3 and a.goal_revision == 1 and a.goal for a in found)
    assert len(await chunks_of(second, 0.6)) >= 3
    later = await second.list_agents("s")
    assert all(b.position[1] > a.position[1] for a, b in zip(found, later, strict=True))
    [published] = await second.step_session("tool", 1)
    assert [c.seq for c in published.chunks] == [3, 3]


async def test_a_journal_beyond_the_limits_is_refused_before_anything_starts(servers, tmp_path):
    first = await servers.start(open_journal(tmp_path))
    await walking(first, count=4)
    await servers.stop(first)
    journal = open_journal(tmp_path)
    with pytest.raises(ArtifactError, match=r"4 agents; .* limits\.agents 2"):
        MotionService(fake_worlds(journal, limits=Limits(agents=2)))
    journal.stop()


async def test_a_session_that_does_not_fit_stays_in_the_journal(servers, tmp_path):
    first = await servers.start(open_journal(tmp_path))
    await walking(first)
    path = [Goal((0.0, float(n), 0.0), stop=False) for n in range(1, 60)]
    agents = await first.list_agents("s")
    await first.give(agents[0].agent_id, Path(tuple(path)))
    await servers.stop(first)
    second = await servers.start(open_journal(tmp_path), limits=Limits(path_goals=5))
    assert await second.list_sessions() == []
    await servers.stop(second)
    third = await servers.start(open_journal(tmp_path))
    assert len(await third.list_agents("s")) == 3
    await servers.stop(third)
    fourth = await servers.start(open_journal(tmp_path), limits=Limits(path_goals=5))
    await fourth.create_session(SessionSpec("s"))  # its id is free, and used again
    [agent] = await fourth.create_agents("s", people(1))
    await servers.stop(fourth)
    fifth = await servers.start(open_journal(tmp_path))
    assert [a.agent_id for a in await fifth.list_agents("s")] == [agent.agent_id]


async def test_rules_are_compiled_once_it_has_been_started_not_before(monkeypatch):
    called = []
    monkeypatch.setattr(motion_service, "prepare", lambda: called.append(runtime.ready))
    runtime = MotionService(fake_worlds())
    assert not called  # calls are to be answered first
    runtime.start()
    await until_ready(runtime)
    assert called == [False]
    await runtime.stop()


@pytest.mark.parametrize("lock_step", [False, True])
async def test_agents_get_the_ids_that_are_asked_for_once(servers, lock_step):
    runtime = await servers.start()
    await runtime.create_session(SessionSpec("s", lock_step=lock_step))
    made = await runtime.create_agents("s", people(2), ["agent-a", "agent-b"])
    assert [agent.agent_id for agent in made] == ["agent-a", "agent-b"]
    with pytest.raises(AlreadyExists):
        await runtime.create_agents("s", people(2), ["agent-c", "agent-b"])
    assert await runtime.list_agents("s") == made, "all or none"
    await runtime.delete_agent("agent-b")
    await runtime.create_agents("s", people(2), ["agent-c", "agent-b"])
