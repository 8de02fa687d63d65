"""SceneService by gRPC and by HTTP, called by real clients; no call disturbs a stream."""

import json

import grpc
import pytest
from google.rpc.error_details_pb2 import BadRequest
from grpc_status import rpc_status

from tests.navigation.meshes.glb_files import LEVELS, glb
from tests.transport.rig import LIMITS, others_are_undisturbed
from wayfarer.errors import InvalidArgument
from wayfarer.transport.grpc_server.methods import check_points
from wayfarer.v1 import scene_pb2

SQUARE = [{"x": x, "z": z} for x, z in ((-5, -5), (5, -5), (5, 5), (-5, 5))]
YARD = {"floors": [{"outline": [{"y": 0.0, **corner} for corner in SQUARE]}]}
CRATE = {"box": {"position": {"x": 0, "y": 0, "z": 0}, "size": {"x": 9.6, "y": 1, "z": 0.5}}}
OBJ = b"v -5 0 -5\nv 5 0 -5\nv 5 0 5\nv -5 0 5\nf 1 2 3 4\n"


def bad_field(error: grpc.aio.AioRpcError) -> str:
    for packed in rpc_status.from_call(error).details:
        found = BadRequest()
        if packed.Unpack(found):
            return found.field_violations[0].field
    return ""


async def pieces(*sent: object):
    for piece in sent:
        yield scene_pb2.CreateMeshSceneRequest(**piece)


async def test_http_from_scene_to_crowd(rig):
    http = rig.http
    made = await http.post("/v1/scenes", json=YARD)
    assert made.status_code == 201, made.text
    path = f"/v1/scenes/{made.json()['scene_id']}"
    put = await http.put(f"{path}/obstacles/crate", json=CRATE)
    assert put.json()["version"] == 1
    huge = {"box": {**CRATE["box"], "size": {"x": 600, "y": 1, "z": 1}}}
    refused = await http.put(f"{path}/obstacles/crate", json=huge)
    assert refused.json()["errors"][0]["field"] == "box.size"  # as in the body: no `obstacle` there
    ends = {"start": {"x": 0, "y": 0, "z": -3}, "goal": {"x": 0, "y": 0, "z": 3}}
    refused = await http.post(f"{path}/path", json=ends)
    assert refused.status_code == 409
    problem = refused.json()
    assert problem["type"] == "urn:wayfarer:unreachable" and problem["nearest"]["z"] < 0
    assert (await http.delete(f"{path}/obstacles/crate")).json()["version"] == 2
    assert (await http.post(f"{path}/path", json=ends)).json()["length"] == pytest.approx(6)
    drawn = (await http.get(f"{path}/outlines")).json()
    assert {*drawn["triangles"]} == {*range(len(drawn["vertices"]) // 3)}
    picture = await http.get(f"{path}/picture")
    assert picture.headers["content-type"] == "image/png"
    assert picture.content.startswith(b"\x89PNG")
    session = (await http.post("/v1/sessions", json={"scene": made.json()["scene_id"]})).json()
    crowd = await http.post(f"/v1/sessions/{session['session_id']}/crowd", json={"count": 3})
    assert crowd.json() == {"came": 3, "waiting": 0, "reason": ""}
    assert (await http.delete(path)).status_code == 409
    assert (await http.delete(f"/v1/sessions/{session['session_id']}")).status_code == 204
    assert (await http.delete(path)).status_code == 204
    assert (await http.get("/v1/scenes")).json() == {"scenes": []}


async def test_meshes_by_both_transports(rig):
    query = "format=obj&name=hall&radius=0.5&entry=1,0,2&request_id=r"
    made = await rig.http.post(f"/v1/scenes/mesh?{query}", content=OBJ)
    assert made.status_code == 201, made.text
    assert made.json()["area_m2"] == pytest.approx(81, rel=0.05)
    again = await rig.http.post(f"/v1/scenes/mesh?{query}", content=OBJ)
    assert again.json()["scene_id"] == made.json()["scene_id"]
    header = {"header": {"scene": {"walkable": {"radius": 0.5}}, "mesh": {"format": 2}}}
    reply = await rig.scenes.CreateMeshScene(pieces(header, {"data": OBJ[:20]}, {"data": OBJ[20:]}))
    assert reply.scene.area_m2 == pytest.approx(81, rel=0.05)
    assert reply.scene.content_hash != made.json()["content_hash"], "it has an entry"


@pytest.mark.parametrize(
    ("sent", "field"),
    [
        ([], "header"),
        ([{"data": OBJ}], "header"),
        ([{"header": {}}, {"header": {}}], "data"),
        ([{"header": {"mesh": {"format": 2}}}, {"data": b"v nan 0 0"}], "data"),
        ([{"header": {"mesh": {"format": 9}}}], "header.mesh.format"),
        ([{"header": {"mesh": {"unit": -1.0, "format": 2}}}, {"data": OBJ}], "header.mesh.unit"),
        ([{"header": {}}, *[{"data": bytes(8000)}] * 5], "data"),
    ],
)
async def test_a_mesh_that_is_none_is_refused(rig, sent, field):
    session_id, _ = await rig.session()
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await rig.scenes.CreateMeshScene(pieces(*sent))
    assert caught.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert bad_field(caught.value) == field
    await others_are_undisturbed(rig, session_id)


GREEDY = {
    "asset": {"version": "2.0"},
    "buffers": [{"byteLength": 1 << 34}],
    "bufferViews": [{"buffer": 0, "byteLength": 1 << 34}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 1 << 30, "type": "VEC3"}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "nodes": [{"mesh": 0}],
    "scenes": [{"nodes": [0]}],
}


@pytest.mark.parametrize(
    "data",
    [b"", b"glTF", bytes(500), glb({}), glb(GREEDY, bytes(64)), glb(GREEDY, claimed=0xFFFFFFFF)],
    ids=["empty", "cut off", "zeros", "nothing in it", "claims gigabytes", "claims a length"],
)
async def test_hostile_glb_is_refused_and_nobody_is_disturbed(rig, data):
    session_id, _ = await rig.session()
    answer = await rig.http.post("/v1/scenes/mesh", content=data)
    assert answer.status_code == 422, answer.text
    assert answer.json()["errors"][0]["field"] == "data"
    await others_are_undisturbed(rig, session_id)


async def test_a_mesh_that_is_too_large_is_refused_before_it_is_read(rig):
    most = LIMITS.mesh_bytes
    assert (await rig.http.post("/v1/scenes/mesh", content=bytes(most + 1))).status_code == 413

    async def endless():
        for _ in range(most // 1000 + 2):
            yield bytes(1000)

    assert (await rig.http.post("/v1/scenes/mesh", content=endless())).status_code == 413
    assert most > LIMITS.message_bytes
    fits = await rig.http.post("/v1/scenes/mesh?format=obj", content=OBJ + b"#" * 20_000)
    assert fits.status_code == 201


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({}, "floors"),
        ({"floors": [{"outline": []}]}, "floors[0].outline"),
        ({"floors": [{"outline": YARD["floors"][0]["outline"][:2]}]}, "floors[0].outline"),
        ({**YARD, "solids": [{}]}, "solids[0]"),
        ({**YARD, "solids": [{**CRATE, "ramp": CRATE["box"]}]}, "solids[0]"),
        ({**YARD, "solids": [CRATE, {"box": {**CRATE["box"], "size": 1}}]}, "solids[1].box.size"),
        ({**YARD, "walkable": {"radius": 7}}, "walkable.radius"),
        ({**YARD, "walkable": {"radius": 5}}, "walkable.radius"),
        ({**YARD, "entries": [{"x": 1e9, "y": 0, "z": 0}]}, "entries[0]"),
        ({**YARD, "basis": "mars"}, "basis"),
        ({**YARD, "name": "x" * 65}, "name"),
        ({**YARD, "lease_s": 0}, "lease_s"),
        ({**YARD, "lease_s": 1e9}, "lease_s"),
    ],
)
async def test_malformed_scenes_are_told_where_they_are_wrong(rig, body, field):
    answer = await rig.http.post("/v1/scenes", json=body)
    assert answer.status_code == 422, answer.text
    problem = answer.json()
    found = problem["errors"][0]["field"] if "errors" in problem else ""
    assert found == field, problem


async def test_numbers_that_are_none_are_refused(rig):
    text = json.dumps(YARD).replace("-5", "NaN", 1)
    answer = await rig.http.post("/v1/scenes", content=text)
    assert answer.status_code == 422
    floor = {"outline": [*SQUARE[:3], {"x": float("nan")}]}
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await rig.scenes.CreateScene(scene_pb2.CreateSceneRequest(floors=[floor]))
    assert bad_field(caught.value) == "floors[0].outline[3].x"


def test_points_too_many_to_be_read_are_only_counted():
    empty = [{}] * 2000
    floor = {"outline": empty, "holes": [{"points": empty}] * 30}
    request = scene_pb2.CreateSceneRequest(floors=[floor])
    with pytest.raises(InvalidArgument, match="62000 points; allowed: 50000") as caught:
        check_points(request)
    assert caught.value.field == "floors"


async def test_what_a_levels_author_should_know_is_in_the_answer_in_the_scenes_basis(rig):
    data = (LEVELS / "closed_room.obj").read_bytes()
    texts = []
    for basis in ("gltf", "unreal"):
        path = f"/v1/scenes/mesh?format=obj&basis={basis}&mesh_basis=gltf&unit=1"
        answer = await rig.http.post(path, content=data)
        assert answer.status_code == 201
        [note] = answer.json()["notes"]
        assert "ground lies above ground" in note and "name an entry" in note
        texts.append(note.partition(" at (")[2].partition(")")[0])
    gltf, unreal = ([float(word) for word in text.split(", ")] for text in texts)
    assert gltf[1] == pytest.approx(3.2, abs=0.1)  # the roof's height
    assert unreal[2] == pytest.approx(100 * gltf[1], abs=1)
    scene = (await rig.scenes.ListScenes(scene_pb2.ListScenesRequest())).scenes[0]
    assert "ground lies above ground" in scene.notes[0]


async def test_what_is_in_the_way_is_told_alike_by_http_and_grpc(rig):
    data = (LEVELS / "stairs_under_1_85_m.obj").read_bytes()
    answer = await rig.http.post("/v1/scenes/mesh?format=obj", content=data)
    scene_id = answer.json()["scene_id"]
    start, goal = {"x": 0, "y": 0, "z": -2}, {"x": 0, "y": 1.44, "z": 4}
    refused = await rig.http.post(
        f"/v1/scenes/{scene_id}/path", json={"start": start, "goal": goal}
    )
    assert refused.status_code == 409
    told = refused.json()["detail"]
    assert "a headroom of 1.85 m at (" in told and "where 1.9 m are asked for" in told
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await rig.scenes.QueryPath(
            scene_pb2.QueryPathRequest(scene_id=scene_id, start=start, goal=goal)
        )
    assert caught.value.details() == told
