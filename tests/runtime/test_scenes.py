"""Scenes through the runtime's interface: on worker threads, and kept over a restart."""

import asyncio
from dataclasses import replace

import pytest

from tests.runtime.kept_worlds import fake_worlds, open_journal
from tests.world.scenes.grounds import BOX, FIELD, ISLANDS, WALL
from wayfarer.config.limits import Limits
from wayfarer.errors import FailedPrecondition, InvalidArgument, NotFound, Unavailable, Unreachable
from wayfarer.navigation.examples import corridor
from wayfarer.navigation.picture import top_view
from wayfarer.navigation.scene import Scene
from wayfarer.navigation.scene_spec import Box, Cylinder, MeshFile, Prism, Ramp, SceneSpec
from wayfarer.runtime.streams.publications import StreamOptions
from wayfarer.world.agents.agent import AgentSpec, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.events import EventKind
from wayfarer.world.scenes.bake_queue import BakeQueue
from wayfarer.world.scenes.messages import Crowd, SceneSource
from wayfarer.world.scenes.outlines import outlines
from wayfarer.world.scenes.scene_registry import SceneRegistry

SOURCE = SceneSource(SceneSpec((FIELD,), (BOX,)), "field", {"owner": "ada"})
EMPTY = SceneSource(SceneSpec((FIELD,)))
SOUTH = AgentSpec(position=(6.0, 2.0))
NORTH = Goal((6.0, 10.0, 0.0))


async def test_scenes_are_created_listed_drawn_and_deleted(servers):
    runtime = await servers.start()
    scene = await runtime.scenes.create(SOURCE)
    assert [s.scene_id for s in runtime.scenes.registry.infos()] == [scene.scene_id]
    assert runtime.scenes.registry.entry(scene.scene_id).info() == scene
    drawn = await runtime.scenes.look(outlines, scene.scene_id)
    [block] = drawn.solids
    assert {z for _, _, z in block.top} == {2.0} and block.bottom == 0.0
    [(outline, hole)] = drawn.walkable
    assert len(outline) >= 4 and len(hole) >= 4
    assert {z for _, _, z in drawn.vertices} == {0.0}
    assert max(max(t) for t in drawn.triangles) == len(drawn.vertices) - 1
    assert (await runtime.scenes.look(top_view, scene.scene_id)).startswith(b"\x89PNG")
    await runtime.scenes.change(SceneRegistry.delete, scene.scene_id)
    with pytest.raises(NotFound):
        await runtime.scenes.look(outlines, scene.scene_id)


async def test_errors_reach_the_caller(servers):
    runtime = await servers.start()
    with pytest.raises(InvalidArgument):
        await runtime.scenes.create(SceneSource(SceneSpec()))
    with pytest.raises(InvalidArgument, match="mesh"):
        await runtime.scenes.create(SceneSource(SceneSpec(mesh=MeshFile(b"no mesh", "glb"))))
    scene = await runtime.scenes.create(SceneSource(SceneSpec(ISLANDS)))
    with pytest.raises(Unreachable):
        await runtime.scenes.look(Scene.path, scene.scene_id, (6.0, 2.0), (25.0, 6.0))
    way = await runtime.scenes.look(Scene.path, scene.scene_id, (6.0, 2.0), (6.0, 99.0))
    assert way.points[0].tolist() == [6.0, 2.0, 0.0] and way.goal_moved > 80


async def test_what_is_in_the_way_is_told_for_a_path_and_for_a_goal(servers):
    runtime = await servers.start()
    beam = Box((6.0, 6.0), (12.0, 0.4), 0.5, bottom=1.6)
    scene = await runtime.scenes.create(SceneSource(SceneSpec((FIELD,), (beam,))))
    assert "below a headroom of 1.6 m" in str(scene.notes[0])
    with pytest.raises(Unreachable, match=r"headroom of 1\.6 m at .* is in the way"):
        await runtime.scenes.look(Scene.path, scene.scene_id, SOUTH.position, NORTH.position)
    for lock_step in (False, True):
        name = f"s{lock_step}"
        await runtime.create_session(SessionSpec(name, scene=scene.scene_id, lock_step=lock_step))
        [agent] = await runtime.create_agents(name, [SOUTH])
        with pytest.raises(Unreachable, match=r"headroom of 1\.6 m at .* is in the way"):
            await runtime.give(agent.agent_id, NORTH)


async def test_subscribers_are_told_of_what_agents_meet(servers):
    runtime = await servers.start()
    scene = await runtime.scenes.create(EMPTY)
    await runtime.create_session(SessionSpec("s", scene=scene.scene_id))
    with pytest.raises(FailedPrecondition, match="delete its sessions first: 's'"):
        await runtime.scenes.change(SceneRegistry.delete, scene.scene_id)
    [agent] = await runtime.create_agents("s", [SOUTH])
    subscription = await runtime.subscribe("s", StreamOptions())
    await runtime.give(agent.agent_id, NORTH)
    publications = aiter(subscription)

    async def until(found):
        while not (hit := found(await anext(publications))):
            pass
        return hit

    def blocked(published):
        return [event for event in published.events if event.kind is EventKind.BLOCKED]

    await asyncio.wait_for(until(lambda p: (p.chunks.goal_revision == 1).any()), 20)
    await runtime.scenes.change(SceneRegistry.put, scene.scene_id, "wall", WALL)
    [event] = await asyncio.wait_for(until(blocked), 20)
    assert (event.agent_id, event.goal_revision) == (agent.agent_id, 1)
    await runtime.delete_session("s")
    await runtime.scenes.change(SceneRegistry.delete, scene.scene_id)


async def test_lock_step_sessions_are_in_scenes_too(servers):
    runtime = await servers.start()
    scene = await runtime.scenes.create(EMPTY)
    await runtime.create_session(SessionSpec("s", scene=scene.scene_id, lock_step=True))
    [agent] = await runtime.create_agents("s", [SOUTH])
    await runtime.give(agent.agent_id, NORTH)
    before = await runtime.step_session("s", 5)
    await runtime.scenes.change(SceneRegistry.put, scene.scene_id, "wall", WALL)
    after = await runtime.step_session("s", 5)
    assert not [event for published in before for event in published.events]
    told = [(p.scheduled_at, e) for p in after for e in p.events]
    assert [event.kind for _, event in told] == [EventKind.BLOCKED]
    assert told[0][1].at == told[0][0]


async def test_scenes_and_who_is_in_them_survive_a_restart(servers, tmp_path):
    every = SceneSource(
        SceneSpec(
            (FIELD,),
            (
                BOX,
                Ramp((2.0, 2.0), (2.0, 3.0), 0.4),
                Cylinder((9.0, 3.0), 0.4, 1.0),
                Prism(((1.0, 9.0), (2.0, 9.0), (1.5, 10.0)), 1.0),
            ),
            entries=((6.0, 2.0, 0.0),),
        ),
        "all kinds",
        {"owner": "ada"},
    )
    first = await servers.start(open_journal(tmp_path))
    scene = await first.scenes.create(every)
    gone = await first.scenes.create(EMPTY)
    scene = await first.scenes.change(
        SceneRegistry.put, scene.scene_id, "crate", Cylinder((3.0, 6.0), 0.3, 1.0)
    )
    scene = await first.scenes.change(SceneRegistry.put, scene.scene_id, "door", BOX)
    scene = await first.scenes.change(SceneRegistry.remove, scene.scene_id, "door")
    await first.create_session(SessionSpec("s", scene=scene.scene_id, avoid=False))
    [agent] = await first.create_agents("s", [SOUTH])
    await first.give(agent.agent_id, NORTH)
    await first.scenes.change(SceneRegistry.delete, gone.scene_id)
    await servers.stop(first)

    second = await servers.start(open_journal(tmp_path))
    [found] = second.scenes.registry.infos()
    assert (found.scene_id, found.name, found.attributes) == (
        scene.scene_id,
        "all kinds",
        {"owner": "ada"},
    )
    assert (found.content_hash, found.version) == (scene.content_hash, 3)
    assert found.obstacles == {"crate": Cylinder((3.0, 6.0), 0.3, 1.0)}
    assert found.created_at == scene.created_at and found.sessions == 1
    session = await second.get_session("s")
    assert session.spec.scene == scene.scene_id and not session.spec.avoid
    assert (await second.get_agent(agent.agent_id)).goal == NORTH


async def test_a_mesh_survives_a_restart(servers, tmp_path):
    obj = b"v 0 0 0\nv 9 0 0\nv 9 0 9\nv 0 0 9\nf 1 2 3\nf 1 3 4\n"
    first = await servers.start(open_journal(tmp_path))
    made = await first.scenes.create(SceneSource(SceneSpec(mesh=MeshFile(obj, "obj"))))
    await servers.stop(first)
    second = await servers.start(open_journal(tmp_path))
    found = second.scenes.registry.entry(made.scene_id).info()
    assert found.content_hash == made.content_hash and found.area == pytest.approx(made.area)


async def test_a_snapshot_needs_its_scene(servers):
    runtime, other = await servers.start(), await servers.start()
    scene = await runtime.scenes.create(EMPTY)
    await runtime.create_session(SessionSpec("s", scene=scene.scene_id))
    await runtime.create_agents("s", [SOUTH])
    snapshot = await runtime.export_session("s")
    with pytest.raises(FailedPrecondition, match=f"scene '{scene.scene_id}' is not here"):
        await other.import_session(snapshot)
    await runtime.delete_session("s")
    assert (await runtime.import_session(snapshot)).spec.scene == scene.scene_id


def test_an_example_scene_waits_for_no_process():
    queue = BakeQueue(Limits())
    worlds = replace(fake_worlds(), bake_queue=queue)
    worlds.scenes.create(SceneSource(corridor(), "whatever it is called"), 0.0)
    assert queue.pid is None
    queue.stop()  # so that a bake there is refused
    with pytest.raises(Unavailable):
        worlds.scenes.create(EMPTY, 0.0)


async def test_who_leaves_a_crowd_is_told_of_with_the_alias(servers):
    runtime = await servers.start()
    scene = await runtime.scenes.create(EMPTY)
    session = await runtime.create_session(SessionSpec(scene=scene.scene_id))
    assert await runtime.scenes.crowd(session.session_id) is None
    await runtime.create_agents(session.session_id, [SOUTH])
    await runtime.scenes.populate(session.session_id, Crowd(2))
    _, *people = await runtime.list_agents(session.session_id)
    crowd = await runtime.scenes.crowd(session.session_id)
    assert crowd.crowd.count == 2 and crowd.leaves_at.keys() == {one.agent_id for one in people}
    stream = await runtime.subscribe(session.session_id, StreamOptions())
    await runtime.scenes.populate(session.session_id, Crowd(0))
    left = []
    async with asyncio.timeout(20):
        while len(left) < 2:
            events = (await anext(stream)).events
            left += [(e.agent_id, e.alias) for e in events if e.kind is EventKind.AGENT_LEFT]
    assert sorted(left) == sorted((one.agent_id, one.alias) for one in people)
    await stream.close()
