import asyncio
from contextlib import aclosing
from types import SimpleNamespace

import pytest

from tests.transport.fakes import FakeService, opened
from tests.transport.gateway.calls import TWO, called_by, caller, session, stream, take
from tests.transport.samples import NOW
from wayfarer.config.limits import Limits
from wayfarer.errors import (
    Aborted,
    FailedPrecondition,
    InvalidArgument,
    NotFound,
    ResourceExhausted,
    Unavailable,
    Unreachable,
)
from wayfarer.transport import schema
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.edge.caller import Quota
from wayfarer.transport.gateway import Gateway, uploads
from wayfarer.transport.gateway.scene_access import SCENE_LEASE_S
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.events import Event, EventKind

YARD = schema.NewScene.model_validate(
    schema.NewScene.model_config["json_schema_extra"]["examples"][0]
)
CRATE = YARD.solids[0].box


def vector(x: float, y: float, z: float) -> schema.Vector3:
    return schema.Vector3(x=x, y=y, z=z)


async def yard(api: Gateway, **changes: object) -> schema.Scene:
    return await api.scenes.create(YARD.model_copy(update=changes))


async def in_pieces(*pieces: bytes):
    for piece in pieces:
        yield piece


OBJ = b"v -10 0 -10\nv 10 0 -10\nv 10 0 10\nv -10 0 10\nf 1 2 3 4\n"
OBJ_REQUEST = schema.MeshScene(mesh=schema.Mesh(format="obj"))


async def test_a_scene_lives_until_it_is_deleted(api):
    made = await yard(api)
    assert (made.name, made.islands, made.sessions) == ("yard", 1, 0)
    assert 300 < made.area_m2 < 400 - 2 and made.basis.basis is Basis.GLTF
    assert (made.min, made.max) == (vector(-10, 0, -10), vector(10, 0, 10))
    assert await api.scenes.get(made.scene_id) == made
    assert (await api.scenes.list_own()).scenes == (made,)
    await api.scenes.delete(made.scene_id)
    for call in (api.scenes.get, api.scenes.delete, api.scenes.outlines, api.scenes.picture):
        with pytest.raises(NotFound, match=made.scene_id):
            await call(made.scene_id)
    assert (await api.scenes.list_own()).scenes == ()


async def test_sessions_are_in_scenes_of_their_caller(api):
    made = await yard(api)
    session_id = await session(api, scene=made.scene_id, avoid=False)
    found = await api.sessions.get(session_id)
    assert (found.scene, found.avoid) == (made.scene_id, False)
    assert (await api.scenes.get(made.scene_id)).sessions == 1
    with pytest.raises(FailedPrecondition, match="is in use; delete its sessions first"):
        await api.scenes.delete(made.scene_id)
    with called_by(caller("ada")):
        for scene_id in (made.scene_id, "scene-99"):
            with pytest.raises(NotFound, match="there is no scene") as caught:
                await session(api, scene=scene_id)
            assert caught.value.kind == "scene"
        with pytest.raises(NotFound):
            await api.scenes.put_obstacle(made.scene_id, "a", schema.Obstacle(box=CRATE))
        assert (await api.scenes.list_own()).scenes == ()
    await api.sessions.delete(session_id)
    await api.scenes.delete(made.scene_id)


async def test_a_request_sent_twice_makes_one_scene(service, api):
    made = [await yard(api, request_id="r") for _ in range(2)]
    assert made[0] == made[1] and len(service.registry.infos()) == 1
    with pytest.raises(Aborted):
        await yard(api, request_id="r", name="other")
    mesh = OBJ_REQUEST.model_copy(update={"scene": schema.NewScene(request_id="m")})
    twice = [await api.scenes.create_from_mesh(mesh, in_pieces(OBJ)) for _ in range(2)]
    assert twice[0] == twice[1] and len(service.registry.infos()) == 2
    with pytest.raises(Aborted):
        await api.scenes.create_from_mesh(mesh, in_pieces(OBJ + b"#"))


async def test_scenes_of_a_caller_are_limited_also_those_in_the_making():
    api = await opened(limits=Limits(scenes_per_caller=2))
    made = await asyncio.gather(*(yard(api) for _ in range(4)), return_exceptions=True)
    refused = [error for error in made if isinstance(error, ResourceExhausted)]
    assert len(refused) == 2 and "may have 2" in str(refused[0])
    with called_by(caller("ada")):
        await yard(api)
    with called_by(caller("ada")):
        with pytest.raises(InvalidArgument):
            await yard(api, floors=())
        await yard(api)  # no room is lost by failing


async def test_a_scene_that_cannot_be_removed_now_is_kept_and_removed_later(service, clock, api):
    made, change = await yard(api, lease_s=50), service.change

    async def refuse(*_: object) -> None:
        raise Unavailable("the session is being moved; try again")

    clock.now += 51
    service.change = refuse
    await api.end_expired_sessions()
    assert api.moves.scenes == [made.scene_id]
    service.change = change
    await api.end_expired_sessions()
    assert service.registry.infos() == [] == api.moves.scenes


async def test_a_scene_outlives_its_last_session_and_call_by_its_lease(service, clock, api):
    made, forgotten = await yard(api, lease_s=50), await yard(api)
    assert (made.lease_s, forgotten.lease_s) == (50, SCENE_LEASE_S)
    session_id = await session(api, scene=made.scene_id, lease_s=500)
    clock.now += 60
    await api.end_expired_sessions()
    clock.now += 49
    await api.end_expired_sessions()
    await api.sessions.delete(session_id)
    assert {s.scene_id for s in (await api.scenes.list_own()).scenes} == {
        made.scene_id,
        forgotten.scene_id,
    }
    clock.now += 51
    await api.end_expired_sessions()
    assert [s.scene_id for s in (await api.scenes.list_own()).scenes] == [forgotten.scene_id]
    with pytest.raises(NotFound):
        service.registry.entry(made.scene_id)


async def test_scenes_are_taken_over_after_a_restart():
    service = FakeService()
    made = await yard(await opened(service), basis=Basis.UNITY)
    again = await opened(service)
    assert (await again.scenes.get(made.scene_id)).basis.basis is Basis.UNITY


@pytest.mark.parametrize("lease_s", ["nan", "0.5", "an hour"])
async def test_a_kept_scene_without_a_lease_is_removed(service, api, lease_s):
    made = await yard(api)
    service.registry.entry(made.scene_id).source.attributes["lease_s"] = lease_s
    await opened(service)
    assert service.registry.infos() == []


async def test_obstacles_come_move_and_go(api):
    made = await yard(api)
    first = await api.scenes.put_obstacle(made.scene_id, "crate", schema.Obstacle(box=CRATE))
    second = await api.scenes.put_obstacle(
        made.scene_id,
        "crate",
        schema.Obstacle(cylinder={"position": vector(-5, 0, 0), "radius": 1, "height": 2}),
    )
    assert (first.version, second.version) == (1, 2) and second.area_m2 < made.area_m2
    (told,) = (await api.scenes.get(made.scene_id)).obstacles
    assert told.name == "crate" and told.obstacle.cylinder.position == vector(-5, 0, 0)
    assert (await api.scenes.outlines(made.scene_id)).obstacles[0].name == "crate"
    thin = CRATE.model_copy(update={"size": schema.Extents(x=1, y=0.001, z=1)})
    with pytest.raises(InvalidArgument) as caught:
        await api.scenes.put_obstacle(made.scene_id, "crate", schema.Obstacle(box=thin))
    assert caught.value.field == "obstacle.box.size"
    assert (await api.scenes.remove_obstacle(made.scene_id, "crate")).version == 3
    with pytest.raises(NotFound):
        await api.scenes.remove_obstacle(made.scene_id, "crate")


async def test_ways_are_told_or_how_far_one_gets(api):
    made = await yard(api)
    asked = schema.PathQuery(start=vector(0, 0, -5), goal=vector(0, 0, 8))
    way = await api.scenes.query_path(made.scene_id, asked)
    assert way.points[0] == vector(0, 0, -5) and way.length > 13.0, "around the crate"
    outside = asked.model_copy(update={"goal": vector(0, 0, 12)})
    assert (await api.scenes.query_path(made.scene_id, outside)).goal_moved == pytest.approx(
        2.3, abs=0.05
    )
    far = asked.model_copy(update={"goal": vector(0, 0, 1e6)})
    with pytest.raises(InvalidArgument) as caught:
        await api.scenes.query_path(made.scene_id, far)
    assert caught.value.field == "goal"
    wall = schema.Box(position=vector(0, 0, 6), size=schema.Extents(x=20, y=2, z=0.2))
    await api.scenes.put_obstacle(made.scene_id, "wall", schema.Obstacle(box=wall))
    with pytest.raises(Unreachable) as unreachable:
        await api.scenes.query_path(made.scene_id, asked)
    x, y, z = unreachable.value.nearest
    assert (x, y) == pytest.approx((0, 0)) and 5 < z < 6


async def test_examples_are_listed_and_made(api):
    names = [example.name for example in api.scenes.examples().examples]
    assert "corridor" in names and all(e.summary for e in api.scenes.examples().examples)
    made = await api.scenes.create_example("corridor", schema.NewExampleScene(basis=Basis.UNREAL))
    assert made.name == "corridor" and made.basis.metres_per_unit == 0.01
    with pytest.raises(NotFound, match="there are cubes_field, town_square"):
        await api.scenes.create_example("moon", schema.NewExampleScene())


async def test_a_mesh_comes_in_pieces():
    service = FakeService()
    api = await opened(service, Limits(mesh_bytes=1024))
    made = await api.scenes.create_from_mesh(OBJ_REQUEST, in_pieces(OBJ[:9], b"", OBJ[9:]))
    assert made.area_m2 == pytest.approx(19.4**2, rel=0.01)
    for data, what in (
        (b"hello", "no triangle|vertices"),
        (b"", "no triangle|empty|vertices"),
        (b"v nan 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3", "not finite"),
    ):
        with pytest.raises(InvalidArgument, match=what) as caught:
            await api.scenes.create_from_mesh(OBJ_REQUEST, in_pieces(data))
        assert caught.value.field == "data"
    with pytest.raises(InvalidArgument, match="1024 bytes at most"):
        await api.scenes.create_from_mesh(OBJ_REQUEST, in_pieces(*[b"#" * 100] * 11))


async def test_few_meshes_are_received_at_a_time_and_none_for_ever(monkeypatch):
    monkeypatch.setattr(uploads, "WHOLE_S", 0.05)
    api = await opened()

    async def slow():
        yield b"v 0 0 0"
        await asyncio.sleep(30)

    waiting = [
        asyncio.create_task(api.scenes.create_from_mesh(OBJ_REQUEST, slow()))
        for _ in range(uploads.MAX_UPLOADS)
    ]
    await asyncio.sleep(0)
    with pytest.raises(ResourceExhausted) as caught:
        await api.scenes.create_from_mesh(OBJ_REQUEST, in_pieces(OBJ))
    assert caught.value.retry_after > 0
    for task in waiting:
        with pytest.raises(InvalidArgument, match="has not come within"):
            await task
    await api.scenes.create_from_mesh(OBJ_REQUEST, in_pieces(OBJ))


async def test_people_come_to_a_session_that_is_in_a_scene():
    service = FakeService()
    api = await opened(service, Limits(agents_per_session=5))
    made = await yard(api)
    session_id = await session(api, scene=made.scene_id)
    assert (await api.scenes.populate(session_id, schema.Crowd(count=3, seed=4))).came == 3
    assert (service.crowds[0][0], service.crowds[0][1].seed) == (session_id, 4)
    with pytest.raises(InvalidArgument, match="allowed: 5") as caught:
        await api.scenes.populate(session_id, schema.Crowd(count=6))
    assert caught.value.field == "count"
    with pytest.raises(FailedPrecondition, match="in no scene"):
        await api.scenes.populate(await session(api), schema.Crowd(count=1))


async def test_people_of_a_crowd_count_as_the_agents_of_their_caller(service, api):
    with called_by(caller("ada", quota=Quota(agents=4))):
        made = await yard(api)
        one, other = [await session(api, scene=made.scene_id) for _ in range(2)]
        await api.scenes.populate(one, schema.Crowd(count=3))
        with pytest.raises(ResourceExhausted, match="has 3 agents and may have 4; 2 more"):
            await api.scenes.populate(other, schema.Crowd(count=2))
        with pytest.raises(ResourceExhausted, match="2 more"):
            await api.agents.create(one, TWO)
        await api.scenes.populate(one, schema.Crowd(count=4))  # instead of the three
        await api.scenes.populate(one, schema.Crowd(count=2))
        await api.agents.create(one, TWO)


async def test_a_crowd_counts_though_its_caller_has_gone_away(service, api):
    populate, going = service.populate, asyncio.Event()

    async def slowly(*parts: object):
        await going.wait()
        return await populate(*parts)

    service.populate = slowly
    with called_by(caller("ada", quota=Quota(agents=4))):
        session_id = await session(api, scene=(await yard(api)).scene_id)
        call = asyncio.create_task(api.scenes.populate(session_id, schema.Crowd(count=3)))
        await asyncio.sleep(0.01)
        call.cancel()
        for _ in range(2):
            with pytest.raises(ResourceExhausted, match="has 3 agents"):
                await api.agents.create(session_id, TWO)
            going.set()
            await asyncio.sleep(0.01)
    assert len(service.crowds) == 1


async def test_people_of_a_crowd_who_were_asked_for_do_not_stay_in_the_book(service, api):
    with called_by(caller("ada", quota=Quota(agents=2))):
        session_id = await session(api)
        for leaves in (service.delete_agent, api.agents.delete) * 2:
            (guest,) = await service.create_agents(session_id, [AgentSpec()])
            await api.agents.get(guest.agent_id)
            await leaves(guest.agent_id)
        await api.agents.create(session_id, TWO)


async def test_a_crowd_that_comes_from_another_server_counts_as_it_was_asked_for(service, api):
    with called_by(caller("ada", quota=Quota(agents=4))):
        made = await yard(api)
        session_id = await session(api, scene=made.scene_id)
        await api.agents.create(session_id, schema.NewAgents(agents=[schema.AgentSpec()]))
        await api.scenes.populate(session_id, schema.Crowd(count=2))
        (guest,) = await service.create_agents(session_id, [AgentSpec()])
        service.people = [guest.agent_id]
        info = await service.get_session(session_id)

        async def comes(*_: object) -> object:
            return info

        service.moves = SimpleNamespace(read=comes, import_=comes, unfreeze=comes)
        await api.moves.enter(await api.moves.take(session_id, b"", b"", orphan=True))
        await service.delete_agent(guest.agent_id)
        with pytest.raises(ResourceExhausted, match="has 3 agents and may have 4; 2 more"):
            await api.agents.create(session_id, TWO)


async def test_a_stream_is_told_of_one_of_a_crowd_who_is_deleted(service, api):
    session_id = await session(api)
    (guest,) = await service.create_agents(session_id, [AgentSpec()])
    async with aclosing(stream(api, session_id)) as messages:
        await anext(messages)
        service.emit(session_id)
        await anext(messages)
        await api.agents.delete(guest.agent_id)
        service.emit(session_id)
        assert list((await anext(messages)).batch.removed) == [guest.alias]


async def test_people_of_a_crowd_can_be_told_what_to_do_though_no_call_created_them(service, api):
    session_id = await session(api)
    (guest,) = await service.create_agents(session_id, [AgentSpec()])
    goal = schema.Goal(position=vector(1, 0, 2))
    assert await api.goals.set_goal(guest.agent_id, goal) == schema.GoalRevision(revision=1)
    assert (await api.agents.get(guest.agent_id)).alias == guest.alias
    with called_by(caller("ada")), pytest.raises(NotFound, match="there is no agent"):
        await api.goals.set_goal(guest.agent_id, goal)


async def test_an_unreachable_goal_is_told_in_the_basis_of_the_session(service, api):
    session_id = await session(api, basis=Basis.UNREAL)
    agents = await api.agents.create(session_id, schema.NewAgents(agents=[schema.AgentSpec()]))

    async def refuse(*_: object) -> int:
        raise Unreachable("no way", (1.0, 2.0, 3.0))

    service.give = refuse
    with pytest.raises(Unreachable) as caught:
        goal = schema.Goal(position=vector(0, 0, 0))
        await api.goals.set_goal(agents.agents[0].agent_id, goal)
    assert caught.value.nearest == pytest.approx((200, 100, 300))


async def test_a_stream_is_told_who_of_a_crowd_has_left(service, api):
    made = await yard(api)
    session_id = await session(api, scene=made.scene_id)
    one, other = await service.create_agents(session_id, [AgentSpec()] * 2)
    messages = stream(api, session_id)
    await take(messages, 1)
    service.emit(session_id)
    (first,) = await take(messages, 1)
    assert [agent.alias for agent in first.batch.added] == [1, 2]
    await service.delete_agent(one.agent_id)
    service.emit(session_id, Event(EventKind.AGENT_LEFT, NOW, one.agent_id, one.alias))
    _, left = await take(messages, 2)
    assert (left.event.agent_id, left.event.alias) == (one.agent_id, 1)
    service.emit(session_id)
    (after,) = await take(messages, 1)
    assert list(after.batch.removed) == [1] and list(after.batch.chunks.aliases) == [2]
    token = after.batch.resume_token
    await messages.aclose()
    (guest,) = await service.create_agents(session_id, [AgentSpec()])
    await api.agents.create(session_id, schema.NewAgents(agents=[schema.AgentSpec()]))
    resumed = stream(api, session_id, resume_token=token)
    await take(resumed, 1)
    service.emit(session_id)
    (batch,) = await take(resumed, 1)
    assert list(batch.batch.removed) == [1], "and not the guest, whom no call has created"
    assert list(batch.batch.chunks.aliases) == [other.alias, guest.alias, 4]
    await resumed.aclose()


async def test_who_of_a_crowd_comes_while_a_stream_resumes_is_shown(service, api):
    made = await yard(api)
    session_id = await session(api, scene=made.scene_id)
    subscribe, one = service.subscribe, schema.NewAgents(agents=[schema.AgentSpec()])

    async def meanwhile(*options: object):
        await service.create_agents(session_id, [AgentSpec()])
        await api.agents.create(session_id, one)
        return await subscribe(*options)

    service.subscribe = meanwhile
    async with aclosing(stream(api, session_id, resume_token="before.1")) as messages:
        await anext(messages)
        service.emit(session_id)
        (batch,) = await take(messages, 1)
    assert not batch.batch.removed and list(batch.batch.chunks.aliases) == [1, 2]
