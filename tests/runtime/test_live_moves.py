"""Live sessions and scenes that go from one server to another."""

import asyncio

import pytest

from tests.runtime.kept_worlds import assert_same_poses
from tests.runtime.test_moving import COMMANDS, goals
from tests.world.scenes.grounds import BOX, FIELD
from wayfarer.config.limits import Limits
from wayfarer.endpoint import Endpoint
from wayfarer.errors import (
    AlreadyExists,
    FailedPrecondition,
    InvalidArgument,
    Misdirected,
    ResourceExhausted,
)
from wayfarer.ids import group_of
from wayfarer.navigation.scene_spec import Cylinder, SceneSpec
from wayfarer.runtime.persistence import scene_entries
from wayfarer.runtime.streams.publications import Resume, StreamOptions
from wayfarer.world.agents.agent import AgentSpec, ChunkFlag, SessionSpec
from wayfarer.world.scenes.messages import Crowd, SceneSource
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.stepping.admission import Admission
from wayfarer.world.stepping.settings import AdmissionRules

ELSEWHERE = Misdirected("elsewhere", Endpoint(1, 2, 3, "b"))


async def collected(subscription, count):
    return [await anext(subscription) for _ in range(count)]


async def test_a_subscriber_misses_nothing_when_its_session_moves(servers):
    here, there = await servers.start(), await servers.start()
    session = (await here.create_session(SessionSpec())).session_id
    people = await here.create_agents(session, [AgentSpec(noise_seed=i) for i in range(6)])
    for person in people:
        await here.give(person.agent_id, goals((20, 20))[0])
    subscription = await here.subscribe(session, StreamOptions())
    reading = asyncio.create_task(until_elsewhere(subscription))
    await asyncio.sleep(0.7)
    await here.moves.freeze(session)
    waiting = asyncio.create_task(here.give(people[0].agent_id, goals((0, -9))[0]))
    data = await here.moves.export(session)
    arrived = await there.moves.read(data)
    await there.moves.import_(arrived)
    await there.moves.unfreeze(session)
    await here.moves.release(session, ELSEWHERE)
    with pytest.raises(Misdirected):
        await waiting
    before = await reading
    resume = Resume(subscription.epoch, before[-1].position)
    follows = await there.subscribe(session, StreamOptions(resume=resume))
    assert await there.give(people[0].agent_id, goals((0, -9))[0]) == 2
    async with asyncio.timeout(10):
        after = await collected(follows, count=12)
    positions = [p.position for p in before + after]
    assert positions == list(range(positions[0], positions[0] + len(positions)))
    seqs = {}
    for publication in before + after:
        for chunk in publication.chunks:
            last = seqs.setdefault(chunk.agent_id, chunk.seq - 1)
            assert chunk.seq == last + 1
            seqs[chunk.agent_id] = chunk.seq
    assert len(seqs) == 6
    flags = {flag for p in after for flag in p.chunks.flags.tolist()}
    assert not any(flag & (ChunkFlag.FIRST | ChunkFlag.GAP) for flag in flags)
    assert not any(p.events for p in after if any(e.kind == "gap" for e in p.events))
    assert await here.list_sessions() == []


async def test_a_reader_is_not_slow_because_all_that_is_planned_leaves_at_once(servers):
    here = await servers.start(lead=10, limits=Limits(queue_s=1.0))  # 2 s are planned ahead
    session = (await here.create_session(SessionSpec())).session_id
    (walker,) = await here.create_agents(session, [AgentSpec()])
    await here.give(walker.agent_id, goals((20, 20))[0])
    subscription = await here.subscribe(session, StreamOptions())
    before = await collected(subscription, count=5)
    await here.moves.freeze(session)
    await here.moves.release(session, ELSEWHERE)
    after = await until_elsewhere(subscription)
    assert len(after) > 6, "more than a second"
    assert not any(p.events for p in after)
    positions = [p.position for p in before + after]
    assert positions == list(range(positions[0], positions[0] + len(positions)))


async def until_elsewhere(subscription):
    found = []
    with pytest.raises(Misdirected):
        while True:
            found.append(await anext(subscription))
    return found


async def test_what_cannot_go_goes_on_here(servers):
    here = await servers.start()
    there = await servers.start(limits=Limits(agents=2))
    session = (await here.create_session(SessionSpec())).session_id
    people = await here.create_agents(session, [AgentSpec(noise_seed=i) for i in range(3)])
    subscription = await here.subscribe(session, StreamOptions())
    await here.moves.freeze(session)
    data = await here.moves.export(session)
    with pytest.raises(ResourceExhausted):
        await there.moves.import_(await there.moves.read(data))
    assert await there.list_sessions() == []
    with pytest.raises(AlreadyExists):
        await here.moves.import_(await here.moves.read(data))
    waiting = asyncio.create_task(here.give(people[0].agent_id, goals((9, 0))[0]))
    await asyncio.sleep(0)
    await here.moves.unfreeze(session)
    assert await waiting == 1
    async with asyncio.timeout(10):
        found = await collected(subscription, count=12)
    seqs = [c.seq for p in found for c in p.chunks if c.agent_id == people[1].agent_id]
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))


async def test_damaged_bytes_are_refused(servers):
    here = await servers.start()
    session = (await here.create_session(SessionSpec())).session_id
    await here.create_agents(session, [AgentSpec()])
    await here.moves.freeze(session)
    data = await here.moves.export(session)
    for damaged in (data[:-9], data[:200], b"x" + data, data + b"x", b""):
        with pytest.raises((InvalidArgument, FailedPrecondition)):
            await here.moves.read(damaged)
    await here.moves.unfreeze(session)


async def stepping(runtime):
    """A session in lock-step with two people who walk, and one for each of `COMMANDS`."""
    spec = SessionSpec(lock_step=True, record=True)
    session = (await runtime.create_session(spec)).session_id
    specs = [AgentSpec(noise_seed=i) for i in range(2 + len(COMMANDS))]
    people = await runtime.create_agents(session, specs)
    for person, command in zip(people[2:], COMMANDS, strict=True):
        await runtime.give(person.agent_id, command)
    await runtime.give(people[0].agent_id, goals((1, 0), (1, 1))[0])
    await runtime.give(people[1].agent_id, goals((9, 0))[0])
    return session


async def test_a_session_in_lock_step_moves_between_two_steps_and_goes_on_bit_for_bit(servers):
    here, there = await servers.start(), await servers.start()
    stays, moves = await stepping(here), await stepping(here)
    expected = await here.step_session(stays, 4)
    found = await here.step_session(moves, 4)
    await here.moves.freeze(moves)
    waiting = asyncio.create_task(here.step_session(moves, 1))
    data = await here.moves.export(moves)
    await there.moves.import_(await there.moves.read(data))
    await there.moves.unfreeze(moves)
    await here.moves.release(moves, ELSEWHERE)
    with pytest.raises(Misdirected):
        await waiting
    expected += await here.step_session(stays, 12)
    found += await there.step_session(moves, 12)
    assert [p.position for p in found] == [p.position for p in expected]
    for one, other in zip(found, expected, strict=True):
        assert [(e.kind, e.at) for e in one.events] == [(e.kind, e.at) for e in other.events]
        for name in ("seq", "scheduled_at", "translation", "rotations", "contacts", "flags"):
            assert getattr(one.chunks, name).tobytes() == getattr(other.chunks, name).tobytes()
    assert any(p.events for p in found[4:])
    await same_as_replayed(there, moves, found)
    assert [s.session_id for s in await here.list_sessions()] == [stays]


async def test_a_session_in_lock_step_that_is_not_moved_after_all_goes_on_bit_for_bit(servers):
    here = await servers.start()
    one, other = await stepping(here), await stepping(here)
    await here.step_session(one, 4)
    await here.step_session(other, 4)
    await here.moves.freeze(other)
    await here.moves.export(other)
    await here.moves.unfreeze(other)
    for a, b in zip(
        await here.step_session(one, 8), await here.step_session(other, 8), strict=True
    ):
        for name in ("seq", "scheduled_at", "translation", "flags"):
            assert getattr(a.chunks, name).tobytes() == getattr(b.chunks, name).tobytes()


async def test_a_scene_of_another_release_is_baked_again(servers, monkeypatch):
    here, there = await servers.start(), await servers.start()
    made = await here.scenes.create(SceneSource(SceneSpec((FIELD,), (BOX,)), "field"))
    with monkeypatch.context() as patch:
        patch.setattr(scene_entries, "__version__", "0")
        content = await here.scene_moves.content(made.scene_id)
    came = await there.scene_moves.import_(
        made.scene_id, content, await here.scene_moves.export(made.scene_id)
    )
    assert (came.area, came.content_hash) == (made.area, made.content_hash)
    record = scene_entries.decode_scene(
        "scene-1", content, await here.scene_moves.export(made.scene_id)
    )
    assert record.baked is None


async def test_a_scene_moves_with_its_sessions_and_its_obstacles(servers):
    here, there = await servers.start(), await servers.start()
    made = await here.scenes.create(SceneSource(SceneSpec((FIELD,), (BOX,)), "field"))
    scene = made.scene_id
    sessions = [(await here.create_session(SessionSpec(scene=scene))).session_id for _ in "ab"]
    assert {group_of(name) for name in sessions} == {group_of(scene)}
    person = (await here.create_agents(sessions[0], [AgentSpec(position=(6.0, 2.0))]))[0].agent_id
    await here.give(person, goals((6, 10))[0])
    await here.scenes.change(SceneRegistry.put, scene, "crate", Cylinder((1.0, 1.0), 0.5, 1.0))
    content = await here.scene_moves.content(scene)
    there.scenes.registry._bake = None  # it is not baked again

    await here.scene_moves.freeze(scene)
    packed = []
    for session in sessions:
        await here.moves.freeze(session)
        packed.append(await here.moves.export(session))
    coming = asyncio.create_task(here.create_session(SessionSpec(scene=scene)))
    changing = asyncio.create_task(here.scenes.change(SceneRegistry.remove, scene, "crate"))
    await there.scene_moves.import_(scene, content, await here.scene_moves.export(scene))
    for session, data in zip(sessions, packed, strict=True):
        await there.moves.import_(await there.moves.read(data))
        await there.moves.unfreeze(session)
        await here.moves.release(session, ELSEWHERE)
    await here.scene_moves.release(scene, ELSEWHERE)
    for waiting in (coming, changing):
        with pytest.raises(Misdirected):
            await waiting
    assert here.scenes.registry.infos() == [] and await here.list_sessions() == []
    moved = there.scenes.registry.entry(scene).info()
    assert moved.sessions == 2 and list(moved.obstacles) == ["crate"]
    assert (moved.content_hash, moved.version) == (made.content_hash, made.version + 1)
    assert (await there.get_agent(person)).goal_revision == 1
    await there.scenes.change(SceneRegistry.remove, scene, "crate")


async def test_a_recorded_session_takes_its_log_along(servers):
    here, there = await servers.start(), await servers.start()
    session = (await here.create_session(SessionSpec(record=True))).session_id
    [person] = await here.create_agents(session, [AgentSpec(noise_seed=3)])
    await here.give(person.agent_id, goals((5, 0))[0])
    subscription = await here.subscribe(session, StreamOptions())
    reading = asyncio.create_task(until_elsewhere(subscription))
    await asyncio.sleep(0.5)
    await here.moves.freeze(session)
    arrived = await there.moves.read(await here.moves.export(session))
    await there.moves.import_(arrived)
    await there.moves.unfreeze(session)
    await here.moves.release(session, ELSEWHERE)
    before = await reading
    resume = Resume(subscription.epoch, before[-1].position)
    follows = await there.subscribe(session, StreamOptions(resume=resume))
    async with asyncio.timeout(10):
        after = await collected(follows, count=4)
    log = await there.export_log(session)
    played = {c.seq: c async for p in there.replay(log) for c in p.chunks}
    streamed = {c.seq: c for p in before + after for c in p.chunks}
    assert set(streamed) <= set(played)
    for seq, chunk in streamed.items():
        assert_same_poses(played[seq], chunk)


async def test_what_was_told_right_before_a_move_is_in_the_log(servers):
    here, there = await servers.start(), await servers.start()
    session = (await here.create_session(SessionSpec(record=True))).session_id
    people = await here.create_agents(session, [AgentSpec(noise_seed=i) for i in range(6)])
    await asyncio.sleep(0.4)
    for person in people:  # one and the other will not have planned for it yet
        await here.give(person.agent_id, goals((5, 0))[0])
    await here.moves.freeze(session)
    await there.moves.import_(await there.moves.read(await here.moves.export(session)))
    await there.moves.unfreeze(session)
    await here.moves.release(session, ELSEWHERE)
    follows = await there.subscribe(session, StreamOptions())
    async with asyncio.timeout(10):
        await same_as_replayed(there, session, await collected(follows, count=12))


async def same_as_replayed(runtime, session, publications):
    """The streamed motion is in the session's log, bit for bit."""
    log = await runtime.export_log(session)
    played = {(c.agent_id, c.seq): c async for p in runtime.replay(log) for c in p.chunks}
    streamed = {(c.agent_id, c.seq): c for p in publications for c in p.chunks}
    assert streamed and set(streamed) <= set(played)
    for key, chunk in streamed.items():
        assert_same_poses(played[key], chunk)


async def lives_on(runtime, copy):
    made = await runtime.moves.import_(await runtime.moves.read(copy), orphan=True)
    await runtime.moves.unfreeze(made.session_id)
    return made


async def test_from_a_replica_a_session_lives_on_where_there_is_no_time_for_it(
    servers, monkeypatch
):
    here = await servers.start()
    there = await servers.start(admission=AdmissionRules(refuse=True))
    session = (await here.create_session(SessionSpec())).session_id
    await here.create_agents(session, [AgentSpec()])
    replica = await here.moves.replica(session)
    exported = await here.export_session(session)
    await servers.stop(here)

    def full(*_):
        raise ResourceExhausted("no time")

    monkeypatch.setattr(Admission, "check", full)
    with pytest.raises(ResourceExhausted, match="no time"):
        await there.import_session(exported)
    assert len((await lives_on(there, replica)).agent_ids) == 1


async def test_a_move_that_came_to_nothing_lives_on_from_what_was_sent(servers):
    here, there = await servers.start(), await servers.start()
    session = (await here.create_session(SessionSpec())).session_id
    (walker,) = await here.create_agents(session, [AgentSpec()])
    await here.give(walker.agent_id, goals((5, 0))[0])
    await here.moves.freeze(session)
    sent = await here.moves.export(session)
    await servers.stop(here)
    await asyncio.sleep(1.0)  # the times in it are over
    await lives_on(there, sent)
    follows = await there.subscribe(session, StreamOptions())
    async with asyncio.timeout(10):
        chunks = [one for each in await collected(follows, count=4) for one in each.chunks]
    assert chunks[0].flags & ChunkFlag.FIRST and chunks[-1].seq == chunks[0].seq + 3


async def test_from_replicas_all_live_on_beyond_the_limits_of_sessions_and_scenes(servers):
    here = await servers.start()
    there = await servers.start(limits=Limits(sessions=1, scenes=1))
    field = SceneSource(SceneSpec((FIELD,)), "field")
    scene = (await here.scenes.create(field)).scene_id
    await there.scenes.create(field)
    copies = []
    for spec in (SessionSpec(), SessionSpec(scene=scene), SessionSpec(lock_step=True)):
        session = (await here.create_session(spec)).session_id
        await here.create_agents(session, [AgentSpec()])
        copies.append(await here.moves.replica(session))
    await there.create_session(SessionSpec())
    await there.create_session(SessionSpec(lock_step=True))
    content, obstacles = await here.scene_moves.content(scene), await here.scene_moves.export(scene)
    await servers.stop(here)

    await there.scene_moves.import_(scene, content, obstacles)
    for copy in copies:
        made = await lives_on(there, copy)
        assert await there.list_agents(made.session_id)
    await there.create_agents(made.session_id, [AgentSpec()])
    for spec in (SessionSpec(), SessionSpec(lock_step=True)):
        with pytest.raises(ResourceExhausted, match="all 1 sessions"):
            await there.create_session(spec)


@pytest.mark.parametrize("lock_step", [False, True])
async def test_from_its_replica_a_recorded_session_lives_on_and_its_log_begins_there(
    servers, lock_step
):
    here, there = await servers.start(), await servers.start()
    session = (await here.create_session(SessionSpec(record=True, lock_step=lock_step))).session_id
    [person] = await here.create_agents(session, [AgentSpec(noise_seed=3)])
    await here.give(person.agent_id, goals((5, 0))[0])
    if lock_step:
        await here.step_session(session, 4)
    replica = await here.moves.replica(session)
    await servers.stop(here)

    assert (await lives_on(there, replica)).session_id == session
    if lock_step:
        after = await there.step_session(session, 6)
    else:
        follows = await there.subscribe(session, StreamOptions())
        async with asyncio.timeout(10):
            after = await collected(follows, count=3)
    await same_as_replayed(there, session, after)


async def test_from_its_replica_a_crowd_comes_and_goes_on(servers):
    here, there = await servers.start(), await servers.start()
    scene = (await here.scenes.create(SceneSource(SceneSpec((FIELD,)), "field"))).scene_id
    session = (await here.create_session(SessionSpec(scene=scene))).session_id
    await here.scenes.populate(session, Crowd(6, seed=3, stay=1.0))
    copy = await here.moves.replica(session)
    people = {agent.spec.name for agent in (await here.moves.read(copy)).record.agents}
    content, obstacles = await here.scene_moves.content(scene), await here.scene_moves.export(scene)
    await servers.stop(here)  # nothing more is heard of it

    await there.scene_moves.import_(scene, content, obstacles)
    await lives_on(there, copy)

    async def names() -> set[str]:
        return {agent.spec.name for agent in await there.list_agents(session)}

    assert await names() & people  # somebody may have left, and another come, at once
    async with asyncio.timeout(30):
        while not (new := await names() - people) or await names() & people == people:
            await asyncio.sleep(0.1)
    assert min(int(name.split()[-1]) for name in new) > len(people), "no person comes twice"
    assert len(await names()) <= 6
    await there.scenes.populate(session, Crowd(0))
    async with asyncio.timeout(30):
        while await names():
            await asyncio.sleep(0.1)


async def test_a_session_without_a_crowd_is_copied_as_a_snapshot(servers):
    runtime = await servers.start()
    session = (await runtime.create_session(SessionSpec())).session_id
    await runtime.create_agents(session, [AgentSpec()])
    copy = await runtime.moves.replica(session)
    await runtime.delete_session(session)
    assert (await runtime.import_session(copy)).session_id == session
