"""A scene lives in one worker, and so do its sessions; through the front all is one server."""

import asyncio

import httpx
import pytest

from tests.transport.rig import LIMITS
from tests.workers.fleet import Rig
from wayfarer.transport import schema
from wayfarer.v1 import scene_pb2, scene_pb2_grpc, session_pb2, session_pb2_grpc

SQUARE = [{"x": x, "y": 0, "z": z} for x, z in ((-5, -5), (5, -5), (5, 5), (-5, 5))]
YARD = {"floors": [{"outline": SQUARE}]}
EXAMPLE = schema.NewExampleScene()
OBJ = b"v -5 0 -5\nv 5 0 -5\nv 5 0 5\nv -5 0 5\nf 1 2 3 4\n"


@pytest.fixture
async def rig(tmp_path):
    async with Rig(tmp_path) as running:
        yield running


async def test_sessions_go_where_their_scene_is_over_both_transports(rig):
    for scene in [(await rig.http.post("/v1/scenes", json=YARD)).json() for _ in range(3)]:
        home, scene_id = scene["endpoint"]["worker"], scene["scene_id"]
        for _ in range(2):
            session = (await rig.http.post("/v1/sessions", json={"scene": scene_id})).json()
            assert session["endpoint"]["worker"] == home
            request = session_pb2.CreateSessionRequest(scene=scene_id)
            stub = session_pb2_grpc.SessionServiceStub(rig.channel)
            assert (await stub.CreateSession(request)).session.endpoint.worker == home
        found = (await rig.http.get(f"/v1/scenes/{scene_id}")).json()
        assert (found["endpoint"]["worker"], found["sessions"]) == (home, 4)
        box = {"position": {"x": 0, "y": 0, "z": 0}, "size": {"x": 1, "y": 1, "z": 1}}
        put = await rig.http.put(f"/v1/scenes/{scene_id}/obstacles/crate", json={"box": box})
        assert put.json()["version"] == 1


async def test_scenes_of_all_workers_are_listed(rig):
    stub = scene_pb2_grpc.SceneServiceStub(rig.channel)
    made = [
        (await stub.CreateExampleScene(scene_pb2.CreateExampleSceneRequest(name="corridor"))).scene
        for _ in range(2)
    ]
    # as workers that hold different numbers of people would get them
    others = [await rig.gateways[i].scenes.create_example("corridor", EXAMPLE) for i in range(2)]
    names = {scene.scene_id for scene in (*made, *others)}
    listed = (await stub.ListScenes(scene_pb2.ListScenesRequest())).scenes
    assert {scene.scene_id for scene in listed} == names
    assert {scene.endpoint.worker for scene in listed} == {0, 1}
    by_http = (await rig.http.get("/v1/scenes")).json()["scenes"]
    assert {scene["scene_id"] for scene in by_http} == names
    assert len((await rig.http.get("/v1/scenes/examples")).json()["examples"]) > 3


async def test_the_wrong_worker_says_which_is_right(rig):
    scene = await rig.gateways[1].scenes.create_example("corridor", EXAMPLE)
    async with httpx.AsyncClient(base_url=rig.servers[0].http_url) as http:
        answer = await http.get(f"/v1/scenes/{scene.scene_id}")
    assert answer.status_code == 421 and answer.json()["endpoint"]["worker"] == 1


async def test_a_mesh_goes_through_the_front_in_pieces(rig):
    async def pieces():
        for start in range(0, len(OBJ), 10):
            yield OBJ[start : start + 10]
            await asyncio.sleep(0)
        yield b"#" * 12_000  # more than another request may have

    query = "format=obj&request_id=r"
    made = await rig.http.post(f"/v1/scenes/mesh?{query}", content=pieces())
    assert made.status_code == 201, made.text
    again = await rig.http.post(f"/v1/scenes/mesh?{query}", content=pieces())
    assert again.json()["scene_id"] == made.json()["scene_id"]
    large = bytes(LIMITS.mesh_bytes + 1)
    assert (await rig.http.post("/v1/scenes/mesh", content=large)).status_code == 413

    async def too_long():
        for _ in range(len(large) // 1000 + 1):
            yield bytes(1000)

    assert (await rig.http.post("/v1/scenes/mesh", content=too_long())).status_code == 413

    async def messages():
        header = {"mesh": {"format": scene_pb2.MESH_FORMAT_OBJ}}
        yield scene_pb2.CreateMeshSceneRequest(header=header)
        yield scene_pb2.CreateMeshSceneRequest(data=OBJ)

    stub = scene_pb2_grpc.SceneServiceStub(rig.channel)
    assert (await stub.CreateMeshScene(messages())).scene.area_m2 > 80
