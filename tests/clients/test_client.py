"""The Python client against real servers over the fake service."""

import asyncio
import contextlib
import threading

import grpc
import numpy as np
import pytest

import wayfarer_client as wf
from tests.transport.fakes import FakeService, gateway
from wayfarer.config.limits import Limits
from wayfarer.transport import errors as server_errors
from wayfarer.transport.server import Server
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import Follow, Wander
from wayfarer.world.goals.commands import Append, Path, Stop
from wayfarer_client.errors import CLASSES


@contextlib.asynccontextmanager
async def serving(service: FakeService, grpc_port: int = 0, limits: Limits | None = None):
    server = Server(gateway(service, limits), "127.0.0.1", 0, grpc_port)
    await server.start()
    await server.until_ready()
    try:
        yield server
    finally:
        await server.stop()


@pytest.fixture
def service():
    return FakeService()


@pytest.fixture
async def server(service):
    async with serving(service) as running:
        yield running


@pytest.fixture
async def client(server):
    async with wf.Client(server.grpc_address) as connected:
        yield connected


async def test_from_session_to_frames(service, client):
    async with await client.create_session("unreal") as session:
        ada, bob = await session.create_agents(
            wf.AgentSpec(name="Ada", seed=1, phenotype=wf.Phenotype(height_m=1.8)),
            wf.AgentSpec(
                gender="male", betas=[1.0] + [0.0] * 9, position=(100, 200, 0), foot_lock=False
            ),
        )
        assert (ada.name, ada.gender, ada.seed, ada.state) == ("Ada", "female", 1, "standing")
        assert (bob.gender, bob.betas[0]) == ("male", 1.0)
        assert bob.position == pytest.approx((100, 200, 90))
        assert ada.rest_offsets.shape == (52, 3)
        assert ada.goal is None and ada.goal_revision == 0
        assert service.specs[1].position == pytest.approx((2.0, 1.0))
        assert [spec.foot_lock for spec in service.specs] == [True, False]

        stream = session.stream()
        reading = asyncio.create_task(anext(stream))
        while not service.subscriptions:
            await asyncio.sleep(0.01)
        sent, _ = service.emit(session.session_id)
        batch = await reading
        assert batch.added == (ada, bob)
        frames, _ = batch
        assert frames.agent == ada and frames.flags == wf.Flag.FIRST
        assert (frames.waypoint, frames.candidates) == (5, 4)
        assert frames.translation.shape == (8, 3) and frames.rotations.shape == (8, 22, 4)
        np.testing.assert_allclose(frames.translation[0], (0, 0, 90), atol=1e-4)
        np.testing.assert_allclose(frames.translation[-1], (70, 0, 90), atol=1e-4)
        np.testing.assert_array_equal(frames.contacts, sent.contacts)
        np.testing.assert_allclose(frames.times, sent.scheduled_at + np.arange(8) / 40, atol=1e-6)

        await session.delete_agent(bob)
        service.emit(session.session_id)
        batch = await anext(stream)
        assert batch.removed == (bob,) and len(batch.frames) == 1
        assert await session.agents() == [await session.agent(ada)]
        await stream.aclose()
    with pytest.raises(wf.NotFound):
        await client.session(session.session_id)


async def test_every_goal_command_arrives(service, client):
    """By calls of a session and, with the same arguments, over its control stream."""
    through = Goal((1.0, 0.0, 0.0), stop=False)
    aside = Goal((0.0, 0.0, 0.0), heading=0.5, strafe=True, dwell=1.5)
    how = {"heading": 0.5, "strafe": True, "dwell": 1.5}
    goals = [wf.Goal((0, -1, 0), stop=False), wf.Goal((0, 0, 0), **how)]
    calls = (
        ("set_goal", (goals[0],), {}),
        ("set_goal", ((0, 0, 0),), how),
        ("set_path", (goals,), {}),
        ("append_goals", (goals,), {}),
        ("append_goals", ([(0, -1, 0), goals[1]],), {}),
        ("wander", ((1, 0, 0), 5.0), {"speed": 0.8}),
        ("behave", (wf.Follow("bo"),), {}),
        ("clear_goal", (), {}),
    )
    async with await client.create_session("ros") as session, session.control() as control:
        (ada,) = await session.create_agents(wf.AgentSpec())
        for way in (session, control):
            for name, given, named in calls:
                call, at = getattr(way, name), len(service.commands)
                assert await call(ada, *given, **named, expected=at) == at + 1
                with pytest.raises(wf.Aborted):
                    await call(ada, *given, **named, expected=99)
    both = (through, aside)
    meant = [
        through,
        aside,
        Path(both),
        Append(both),
        Append((Goal((1.0, 0.0, 0.0)), aside)),
        Wander((0.0, 1.0), 5.0, 0.8),
        Follow("bo"),
        Stop(),
    ]
    assert [command for _, command in service.commands] == meant * 2


async def test_catalogue(client):
    assert (await client.server_info()).fps == 40
    assert len((await client.skeleton()).bones) == 52
    assert [body.name for body in await client.bodies()] == ["anny52", "anny52"]
    assert [model.name for model in await client.models()] == ["fake"]


async def test_errors_have_the_servers_words(client):
    with pytest.raises(wf.NotFound, match="no session 'nobody'"):
        await client.session("nobody")
    async with await client.create_session() as session:
        with pytest.raises(wf.InvalidArgument, match=r"agents\[0\]\.betas"):
            await session.create_agents(wf.AgentSpec(betas=[9.0] * 10))
        with pytest.raises(wf.NotFound):
            await session.set_goal("nobody", (0, 0, 0))
        with pytest.raises(wf.InvalidArgument, match=r"goal\.position\.x"):
            await session.set_goal("nobody", (float("nan"), 0, 0))
    with pytest.raises(wf.InvalidArgument, match="basis: 'maya' is none of gltf, unity"):
        await client.create_session("maya")


def test_every_status_of_the_server_has_its_class():
    for kind, code in server_errors.TABLE.items():
        # two errors share their status: their reason distinguishes them
        special = {"Misdirected": wf.Misdirected, "Unreachable": wf.Unreachable}
        known = special.get(kind.__name__, CLASSES[code.grpc])
        assert known.__name__ == kind.__name__ and issubclass(known, CLASSES[code.grpc])
    assert CLASSES[server_errors.INTERNAL.grpc] is wf.InternalError
    assert CLASSES[grpc.StatusCode.DEADLINE_EXCEEDED] is wf.Unavailable


async def test_no_server(unused_tcp_port):
    with pytest.raises(wf.Unavailable, match=f"no gRPC server at 127.0.0.1:{unused_tcp_port}"):
        await wf.Client(f"127.0.0.1:{unused_tcp_port}", timeout=0.2).connect()


async def test_stream_ends_with_its_session(client):
    session = await client.create_session()
    stream = session.stream()
    reading = asyncio.create_task(anext(stream, None))
    await asyncio.sleep(0.05)
    await session.delete()
    assert await reading is None


async def test_a_slow_stream_is_not_cut(client, monkeypatch):
    """Heartbeats are signs of life, though nothing moves."""
    monkeypatch.setattr("wayfarer.transport.streams.stream.HEARTBEAT_S", 0.05)
    monkeypatch.setattr("wayfarer_client.stream.SILENCE_S", 0.5)
    session = await client.create_session()
    reading = asyncio.create_task(anext(session.stream(deadline=0.1)))
    done, _ = await asyncio.wait({reading}, timeout=1.0)
    assert not done
    reading.cancel()


def test_sync_client_without_a_server(unused_tcp_port):
    before = threading.active_count()
    with pytest.raises(wf.Unavailable):
        wf.SyncClient(f"127.0.0.1:{unused_tcp_port}", timeout=0.2)
    assert threading.active_count() == before
