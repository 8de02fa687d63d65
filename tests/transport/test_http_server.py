"""HTTP, spoken to by a real client."""

import json

import numpy as np
import pytest
import websockets

from wayfarer.transport import codec
from wayfarer.transport.basis import Basis
from wayfarer.v1 import (
    motion_pb2,
)


async def test_http_from_session_to_frames(rig):
    session_id, (agent, other) = await rig.session("unreal")
    path = f"/v1/agents/{agent['agent_id']}"
    goal = {"position": {"x": 250, "y": 0, "z": 0}, "radius": 50, "speed": 100}
    answer = await rig.http.put(path + "/goal", json=goal)
    assert answer.json() == {"revision": 1}
    given = rig.service.goals[0][1]
    assert given.position == pytest.approx((0, 2.5, 0))
    assert (given.radius, given.speed) == pytest.approx((0.5, 1.0))
    assert (await rig.http.delete(path + "/goal")).json() == {"revision": 2}
    goals = [
        {"position": {"x": 100, "y": 0, "z": 0}, "stop": False, "speed": 160},
        {"position": {"x": 0, "y": 50, "z": 0}, "heading": 1.5, "dwell": 2},
    ]
    answer = await rig.http.put(path + "/path", json={"goals": goals})
    assert answer.json() == {"revision": 4}
    first, second = (goal for _, goal in rig.service.goals[2:])
    assert first.position == pytest.approx((0, 1, 0)) and first.speed == pytest.approx(1.6)
    assert not first.stop
    assert second.position == pytest.approx((0.5, 0, 0))
    assert (second.heading, second.stop, second.dwell) == (-1.5, True, 2.0)  # left-handed
    async with rig.socket(session_id) as socket:
        messages = [motion_pb2.StreamMotionResponse.FromString(await socket.recv())]
        (sent, _) = rig.service.emit(session_id)
        messages.append(motion_pb2.StreamMotionResponse.FromString(await socket.recv()))
        assert messages[0].header.basis.metres_per_unit == 0.01
        chunk = messages[1].batch.chunks[0]
        translation, _, _ = codec.decode(chunk.poses, chunk.contacts, Basis.UNREAL)
        np.testing.assert_allclose(translation, sent.translation, atol=1e-5)
        assert (await rig.http.delete(f"/v1/agents/{other['agent_id']}")).status_code == 204
        assert (await rig.http.delete(f"/v1/sessions/{session_id}")).status_code == 204
        with pytest.raises(websockets.ConnectionClosedOK):
            while True:
                await socket.recv()
    assert (await rig.http.get(f"/v1/sessions/{session_id}")).status_code == 404


@pytest.mark.parametrize(
    ("method", "path", "body", "status"),
    [
        ("PUT", "/v1/agents/none/goal", {"position": {"x": 0, "y": 0, "z": 0}}, 404),
        ("PUT", "/v1/agents/none/path", {"goals": [{"position": {"x": 0, "y": 0, "z": 0}}]}, 404),
        ("PUT", "/v1/agents/none/path", {"goals": []}, 422),
        ("PUT", "/v1/agents/none/path", {"goals": [{"position": {"x": 0}}]}, 422),
        ("GET", "/v1/sessions/none", None, 404),
        ("GET", "/v1/agents/" + "x" * 65, None, 422),
        ("GET", "/v1/nothing", None, 404),
        ("PATCH", "/v1/sessions", {}, 405),
        ("POST", "/v1/sessions", {"basis": "maya"}, 422),
        ("POST", "/v1/sessions", {"bases": "gltf"}, 422),
        ("POST", "/v1/sessions/none/agents", {"agents": []}, 422),
        ("POST", "/v1/sessions", {"x": "y" * 9000}, 413),
    ],
)
async def test_every_http_error_is_a_problem_document(rig, method, path, body, status):
    answer = await rig.http.request(method, path, json=body)
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert problem["status"] == status and problem["title"] and problem["detail"]


async def test_malformed_json_is_refused(rig):
    answer = await rig.http.post(
        "/v1/sessions", content="{", headers={"content-type": "application/json"}
    )
    assert answer.status_code == 422


async def test_a_large_body_of_unknown_length_is_refused(rig):
    async def drops():
        for _ in range(20):
            yield b" " * 1000

    answer = await rig.http.post(
        "/v1/sessions", content=drops(), headers={"content-type": "application/json"}
    )
    assert answer.status_code == 413


async def test_glb(rig):
    path = (await rig.http.get("/v1/bodies")).json()["bodies"][1]["glb_path"]
    low = await rig.http.get(path, params={"detail": "low"})
    high = await rig.http.get(path)
    assert low.headers["content-type"] == "model/gltf-binary"
    assert low.content[:4] == high.content[:4] == b"glTF"
    assert len(low.content) < len(high.content)
    shaped = await rig.http.get(path, params={"detail": "low", "betas": "2" + ",0" * 9})
    assert shaped.content != low.content
    again = await rig.http.get(
        path, params={"detail": "low"}, headers={"if-none-match": low.headers["etag"]}
    )
    assert again.status_code == 304 and not again.content


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("anny52-male.glb?betas=1,2", 422),
        ("anny52-male.glb?betas=a", 422),
        ("anny52-male.glb?betas=nan,0,0,0,0,0,0,0,0,0", 422),
        ("anny52-male.glb?detail=huge", 422),
        ("anny52-child.glb", 404),
        ("other-male.glb", 404),
        ("..%2f-male.glb", 404),
    ],
)
async def test_glb_refusals(rig, path, status):
    assert (await rig.http.get("/v1/bodies/" + path)).status_code == status


async def test_viewer_is_served_and_revalidated(rig):
    page = await rig.http.get("/")
    assert page.status_code == 200 and page.headers["content-type"].startswith("text/html")
    assert page.headers["cache-control"] == "no-cache"
    again = await rig.http.get("/", headers={"if-none-match": page.headers["etag"]})
    assert again.status_code == 304
    script = await rig.http.get("/main.js")
    assert script.headers["content-type"].startswith("text/javascript")
    assert (await rig.http.get("/..%2f..%2f__init__.py")).status_code == 404


async def test_openapi_describes_every_route(rig):
    document = (await rig.http.get("/openapi.json")).json()
    assert document["openapi"].startswith("3.")
    operations = [
        (path, method, operation)
        for path, item in document["paths"].items()
        for method, operation in item.items()
    ]
    assert len(operations) == 18
    for path, method, operation in operations:
        assert operation.get("summary"), (method, path)
        if not path.startswith("/v1/health"):
            problem = operation["responses"]["422"]["content"]
            assert list(problem) == ["application/problem+json"], (method, path)
    refs = {part.split('"')[0] for part in json.dumps(document).split('"$ref": "')[1:]}
    assert all(
        ref.removeprefix("#/components/schemas/") in document["components"]["schemas"]
        for ref in refs
    )
