"""Scenes, behaviours and crowds of the Python client, against the transport with a fake runtime."""

import asyncio
import math

import pytest

import wayfarer_client as wf
from tests.transport.rig import Rig
from wayfarer.world import behaviours
from wayfarer.world.agents.goal import Goal

SQUARE = [(-5, 0, -5), (5, 0, -5), (5, 0, 5), (-5, 0, 5)]
OBJ = b"v -5 0 -5\nv 5 0 -5\nv 5 0 5\nv -5 0 5\nf 1 2 3 4\n"
CRATE = wf.Box(position=(0, 0, 0), size=(9.6, 1, 0.5), heading=0.0)


@pytest.fixture
async def rig():
    async with Rig() as running:
        yield running


@pytest.fixture
async def client(rig):
    async with wf.Client(rig.server.grpc_address) as connected:
        yield connected


async def test_a_scene_its_obstacles_and_ways(client):
    scene = await client.scenes.create(
        [wf.Floor(SQUARE, holes=[[(3, 0, 3), (4, 0, 3), (4, 0, 4)]])],
        [
            wf.Box((-4, 0, -4), (1, 1, 1), heading=0.5),
            wf.Cylinder((4, 0, -4), 0.5, 2.0),
            wf.Prism([(-4, 0, 4), (-3, 0, 4), (-3, 0, 3)], height=1.0),
            wf.Ramp((4, 0, 0), (1, 0.5, 2)),
        ],
        name="yard",
        walkable=wf.Walkable(radius=0.4),
        entries=[(0, 0, 0)],
        lease=120,
    )
    assert (scene.message.name, scene.message.lease_s) == ("yard", 120)
    assert await scene.put("crate", CRATE) == 1
    with pytest.raises(wf.Unreachable) as caught:
        await scene.path((0, 0, -3), (0, 0, 3))
    assert isinstance(caught.value, wf.FailedPrecondition) and -1 < caught.value.nearest[2] < 0
    assert (await scene.refresh()).obstacles[0].name == "crate"
    assert await scene.remove("crate") == 2
    way = await scene.path((0, 0, -3), (0, 0, 3))
    assert way.length == pytest.approx(6) and way.points[-1] == pytest.approx((0, 0, 3))
    assert (await scene.picture()).startswith(b"\x89PNG")
    drawn = await scene.outlines()
    assert {*drawn.triangles} == {*range(len(drawn.vertices) // 3)}
    assert [one.scene_id for one in await client.scenes.all()] == [scene.scene_id]
    same = await client.scenes.get(scene.scene_id)
    assert same.message.content_hash == scene.message.content_hash
    await scene.delete()
    with pytest.raises(wf.NotFound):
        await scene.refresh()


async def test_a_mesh_from_bytes_and_from_a_file(client, tmp_path):
    file = tmp_path / "hall.obj"
    file.write_bytes(OBJ)
    one = await client.scenes.create(mesh=file)
    other = await client.scenes.create(mesh=OBJ, mesh_format="obj", mesh_unit=2.0)
    assert other.message.area_m2 > 3.9 * one.message.area_m2
    with pytest.raises(wf.InvalidArgument, match=r"no triangle|vertices") as caught:
        await client.scenes.create(mesh=b"#", mesh_format="obj")
    assert caught.value.field == "data"


async def test_examples_and_the_synchronous_client(rig):
    def use() -> None:
        with wf.SyncClient(rig.server.grpc_address) as client:
            assert "corridor" in client.scenes.examples()
            scene = client.scenes.example("corridor", basis="unreal")
            assert scene.message.basis.metres_per_unit == 0.01
            with client.create_session("ros", scene=scene) as session:
                came = session.populate(3, seed=4, speed=(1.0, 1.2))
                assert came == wf.CrowdCame(3, 0, "")
            scene.delete()
            assert client.scenes.all() == []

    await asyncio.to_thread(use)  # the server runs in this thread
    _, crowd = rig.service.crowds[0]
    assert (crowd.seed, crowd.speed, crowd.dwell) == (4, (1.0, 1.2), (0.0, 4.0))


async def test_behaviours_arrive_as_they_were_meant(rig, client):
    goal = wf.Goal((1, 0, 2))
    meant = (Goal((-1.0, 2.0, 0.0)),)
    async with await client.create_session() as session:
        ada, bo = await session.create_agents(wf.AgentSpec(), wf.AgentSpec())
        told = [
            wf.Wander(),
            wf.Wander((1, 0, 2), 3.0, dwell=2),
            wf.Patrol([goal], to_and_fro=True),
            wf.Follow(bo, behind=2.0),
            wf.KeepAway(place=(1, 0, 2), speed=2.0),
            wf.Queue("till", (1, 0, 2), math.pi),
            wf.Routine([wf.Part(wf.Visit([goal])), wf.Part(wf.Stand(), 3.0)], repeat=True),
        ]
        for number, behaviour in enumerate(told, 1):
            assert await session.behave(ada, behaviour) == number
        async with session.control([ada]) as control:
            assert await control.behave(ada, wf.Follow(bo)) == len(told) + 1
    found = [command for _, command in rig.service.commands]
    assert found == [
        behaviours.Wander(None),
        behaviours.Wander((-1.0, 2.0), 3.0, dwell=2.0),
        behaviours.Patrol(meant, to_and_fro=True),
        behaviours.Follow(bo.agent_id, behind=2.0),
        behaviours.KeepAway(place=(-1.0, 2.0), speed=2.0),
        behaviours.Queue("till", (-1.0, 2.0), math.pi),
        behaviours.Routine(
            (behaviours.Part(behaviours.Visit(meant)), behaviours.Part(behaviours.Stand(), 3.0)),
            repeat=True,
        ),
        behaviours.Follow(bo.agent_id),
    ]
