import asyncio
import contextlib

import pytest

from tests.transport.fakes import Clock, FakeService, gateway
from wayfarer.config import Limits
from wayfarer.errors import InvalidArgument, NotFound, ResourceExhausted, Unavailable
from wayfarer.transport import schema
from wayfarer.transport.basis import Basis

ORIGIN = schema.Vector3(x=0, y=0, z=0)
TWO = [schema.AgentSpec(seed=1), schema.AgentSpec(seed=2, gender="male")]


async def session(api, basis=Basis.GLTF) -> str:
    return (await api.create_session(schema.NewSession(basis=basis))).session_id


async def take(stream, number: int):
    return [await anext(stream) for _ in range(number)]


async def test_each_session_keeps_its_basis():
    service = FakeService()
    api = gateway(service)
    for basis in Basis:
        session_id = await session(api, basis)
        one = basis.axes.points_to_wire(basis.axes.points_to_core(basis.axes.forward))
        place = schema.Vector3(**dict(zip("xyz", one, strict=True)))
        (agent,) = await api.create_agents(session_id, [schema.AgentSpec(position=place)])
        expected = basis.axes.metres_per_unit  # one unit forward
        assert service.specs[-1].position == pytest.approx((0.0, expected))
        assert agent.position.model_dump() == pytest.approx(
            {**place.model_dump(), "xyz"[list(basis.axes.up).index(1)]: 0.9 / expected}
        )
        await api.set_goal(agent.agent_id, schema.Goal(position=place))
        assert service.goals[-1][1].position == pytest.approx((0.0, expected, 0.0))
        assert (await api.get_session(session_id)).basis.basis == basis


async def test_unknown_ids_are_not_found():
    api = gateway()
    goal = schema.Goal(position=ORIGIN)
    for call in (
        api.get_session("x"),
        api.delete_session("x"),
        api.create_agents("x", TWO),
        api.list_agents("x"),
        api.get_agent("x"),
        api.delete_agent("x"),
        api.set_goal("x", goal),
        api.set_path("x", [goal]),
        api.clear_goal("x"),
        anext(api.stream("x")),
    ):
        with pytest.raises(NotFound, match="'x'"):
            await call


async def test_agents_per_call_are_limited():
    api = gateway(limits=Limits(agents_per_call=1))
    session_id = await session(api)
    for specs in ([], TWO):
        with pytest.raises(InvalidArgument) as caught:
            await api.create_agents(session_id, specs)
        assert caught.value.field == "agents"


async def test_nothing_starts_before_the_runtime_is_ready():
    service = FakeService()
    api = gateway(service)
    session_id = await session(api)
    service.ready = False
    assert not api.ready
    for call in (
        api.create_session(schema.NewSession()),
        api.create_agents(session_id, TWO),
        anext(api.stream(session_id)),
    ):
        with pytest.raises(Unavailable, match="not ready"):
            await call


async def test_stream_introduces_agents_with_their_first_chunk():
    service = FakeService()
    api = gateway(service)
    session_id = await session(api)
    first, second = await api.create_agents(session_id, TWO)
    async with contextlib.aclosing(api.stream(session_id)) as stream:
        header = (await anext(stream)).header
        assert header.session_id == session_id and header.fps == 40
        assert len(header.skeleton.bones) == 52 and header.skeleton.posed_bones == 22
        service.emit(session_id)
        batch = (await anext(stream)).batch
        assert [a.agent_id for a in batch.added] == [first.agent_id, second.agent_id]
        assert [c.alias for c in batch.chunks] == [a.alias for a in batch.added]
        service.emit(session_id)
        batch = (await anext(stream)).batch
        assert not batch.added and [c.seq for c in batch.chunks] == [1, 1]
        (third,) = await api.create_agents(session_id, [schema.AgentSpec(name="late")])
        service.emit(session_id)
        assert [a.name for a in (await anext(stream)).batch.added] == [third.name]


async def test_stream_tells_of_deleted_agents_and_drops_their_late_chunks():
    service = FakeService()
    api = gateway(service)
    session_id = await session(api)
    first, second = await api.create_agents(session_id, TWO)
    async with contextlib.aclosing(api.stream(session_id)) as stream:
        await anext(stream)
        service.emit(session_id)
        await anext(stream)
        service.emit(session_id)  # waits in the queue while the agent is deleted
        await api.delete_agent(first.agent_id)
        batch = (await anext(stream)).batch
        assert list(batch.removed) == [first.alias]
        assert [c.alias for c in batch.chunks] == [second.alias]


async def test_an_agent_deleted_before_its_first_chunk_is_never_shown():
    service = FakeService()
    api = gateway(service)
    session_id = await session(api)
    first, second = await api.create_agents(session_id, TWO)
    async with contextlib.aclosing(api.stream(session_id)) as stream:
        await anext(stream)
        service.emit(session_id)
        await service.delete_agent(first.agent_id)  # behind the gateway's back
        batch = (await anext(stream)).batch
        assert [a.alias for a in batch.added] == [c.alias for c in batch.chunks] == [second.alias]


async def test_chosen_agents_only():
    service = FakeService()
    api = gateway(service)
    session_id = await session(api)
    _, second = await api.create_agents(session_id, TWO)
    async with contextlib.aclosing(api.stream(session_id, [second.agent_id])) as stream:
        await anext(stream)
        service.emit(session_id)
        message = await anext(stream)
        assert [c.alias for c in message.batch.chunks] == [second.alias]
    with pytest.raises(NotFound):
        await anext(api.stream(session_id, ["stranger"]))


async def test_heartbeat_when_nothing_happens(monkeypatch):
    monkeypatch.setattr("wayfarer.transport.stream.HEARTBEAT_S", 0.01)
    api = gateway()
    async with contextlib.aclosing(api.stream(await session(api))) as stream:
        kinds = [m.WhichOneof("payload") for m in await take(stream, 3)]
    assert kinds == ["header", "heartbeat", "heartbeat"]


async def test_stream_ends_with_its_session():
    service = FakeService()
    api = gateway(service)
    session_id = await session(api)
    stream = api.stream(session_id)
    await anext(stream)
    await api.delete_session(session_id)
    with pytest.raises(StopAsyncIteration):
        await anext(stream)
    assert service.subscriptions[0].closed


async def test_closing_a_stream_frees_the_subscription_and_its_place():
    service = FakeService()
    api = gateway(service, Limits(streams_per_session=1))
    session_id = await session(api)
    stream = api.stream(session_id)
    await anext(stream)
    with pytest.raises(ResourceExhausted, match="1 streams"):
        await anext(api.stream(session_id))
    await stream.aclose()
    assert service.subscriptions[0].closed
    again = api.stream(session_id)
    await anext(again)
    await again.aclose()


async def test_streams_of_the_server_are_limited():
    api = gateway(limits=Limits(streams=1))
    stream = api.stream(await session(api))
    await anext(stream)
    with pytest.raises(ResourceExhausted) as caught:
        await anext(api.stream(await session(api)))
    assert caught.value.retry_after > 0
    await stream.aclose()


async def test_drain_ends_streams_and_refuses_work():
    service = FakeService()
    api = gateway(service)
    session_id = await session(api)

    async def read() -> None:
        async with contextlib.aclosing(api.stream(session_id)) as stream:
            async for _ in stream:
                pass

    reader = asyncio.create_task(read())
    while not service.subscriptions:
        await asyncio.sleep(0)
    await api.drain(grace=5.0)
    with pytest.raises(Unavailable, match="shutting down"):
        await reader
    assert service.subscriptions[0].closed and not api.ready
    with pytest.raises(Unavailable, match="shutting down"):
        await api.create_session(schema.NewSession())


async def test_a_broken_runtime_ends_streams_with_its_error():
    service = FakeService()
    api = gateway(service)
    stream = api.stream(await session(api))
    await anext(stream)
    service.break_down()
    with pytest.raises(Unavailable, match="has failed"):
        await anext(stream)


async def test_idle_sessions_end():
    clock = Clock()
    api = gateway(limits=Limits(session_idle_s=60), clock=clock)
    idle, called, streamed = [await session(api) for _ in range(3)]
    stream = api.stream(streamed)
    await anext(stream)
    clock.now += 59
    await api.get_session(called)
    clock.now += 2
    assert await api.end_idle_sessions() == [idle]
    with pytest.raises(NotFound):
        await api.get_session(idle)
    await stream.aclose()  # counts as use
    clock.now += 61
    assert await api.end_idle_sessions() == [called, streamed]


async def test_idle_sessions_may_live_for_ever():
    clock = Clock()
    api = gateway(limits=Limits(session_idle_s=0), clock=clock)
    await session(api)
    clock.now += 1e9
    assert await api.end_idle_sessions() == []


async def test_catalogue():
    api = gateway()
    assert [b.gender for b in api.list_bodies()] == ["female", "male"]
    assert all(b.glb_path == f"/v1/bodies/anny52-{b.gender}.glb" for b in api.list_bodies())
    assert api.list_models()[0].name == "fake"
    info = api.server_info()
    assert (info.fps, info.frames_per_chunk) == (40, 8)
    assert {b.basis for b in info.bases} == set(Basis)
    assert (await api.stats()).agents == 1
