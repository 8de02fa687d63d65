"""Files of motion from a real server, by the Python client and over HTTP."""

import time

import httpx
import numpy as np
import pytest

import wayfarer_client as wf
from tests.played import parts
from wayfarer.clips.npz import read_npz

GOALS = [wf.Goal((0, 0, 3))]


@pytest.fixture(scope="module")
def client(real_server):
    with wf.SyncClient(real_server.grpc_address) as connected:
        yield connected


def test_a_clip_as_any_file(client, tmp_path):
    spec = wf.AgentSpec(seed=5, name="Ada")
    for options, begin in (
        (wf.MotionFile(names="ue", root="bone", fps=30, detail="low"), b"glTF"),
        (wf.MotionFile("vrma"), b"glTF"),
        (wf.MotionFile("bvh", unit="cm"), b"HIERARCHY"),
        (wf.MotionFile("npz"), b"PK"),
    ):
        data = client.generate_file(spec, GOALS, 2.0, options)
        assert data.startswith(begin), options
    (tmp_path / "a.npz").write_bytes(data)
    (track,) = wf.tracks(client.generate_clip(spec, GOALS, 2.0, basis="gltf")).values()
    x, y, z = read_npz(tmp_path / "a.npz").translation.T
    np.testing.assert_allclose(np.stack([-x, z, y], 1), track.translation, atol=1e-5)
    with pytest.raises(wf.InvalidArgument, match="vrma has no bone"):
        client.generate_file(spec, GOALS, 2.0, wf.MotionFile("vrma", root="bone"))
    with pytest.raises(wf.InvalidArgument, match="none of glb, bvh, npz, vrma, usd"):
        client.generate_file(spec, GOALS, 2.0, wf.MotionFile("fbx"))


def test_a_loop_is_a_cycle(client):
    options = wf.MotionFile(loop=True, root="in_place", fps=30, detail="low")
    data = client.generate_file(wf.AgentSpec(seed=5), [wf.Goal((0, 0, 12))], 7.0, options)
    gltf = parts(data)[0]
    times = gltf["accessors"][gltf["animations"][0]["samplers"][0]["input"]]
    assert 0.7 < times["max"][0] < 2.5
    with pytest.raises(wf.InvalidArgument, match="no cycle was found"):
        client.generate_file(wf.AgentSpec(seed=5), [], 2.0, options)


def starts(gltf: dict) -> list[float]:
    samplers = gltf["animations"][0]["samplers"]
    return sorted({gltf["accessors"][sampler["input"]]["min"][0] for sampler in samplers})


def test_people_who_come_and_go_are_recorded_with_their_scene(client):
    floor = wf.Floor([(-5, 0, -5), (5, 0, -5), (5, 0, 5), (-5, 0, 5)])
    scene = client.scenes.create(floors=[floor])
    low = wf.MotionFile(detail="low", fps=30)
    with client.create_session(scene=scene) as session:
        (ada,) = session.create_agents(wf.AgentSpec(name="Ada"))
        session.create_agents(wf.AgentSpec(name="Bob", gender="male", position=(-2, 0, 0)))
        session.set_goal(ada, (1, 0, 2))
        gltf = parts(session.export_motion(1.0, low))[0]
        with pytest.raises(wf.InvalidArgument, match="bvh holds one person, not 2"):
            session.export_motion(0.4, wf.MotionFile("bvh"))
        with pytest.raises(wf.FailedPrecondition, match="record"):
            session.export_motion()
        with pytest.raises(wf.InvalidArgument, match="120 s at most, not 999"):
            session.export_motion(999)
    scene.delete()
    names = [gltf["nodes"][k]["name"] for k in gltf["scenes"][0]["nodes"]]
    assert names == ["Ada", "Ada body", "Bob", "Bob body", "scene"]
    samplers = gltf["animations"][0]["samplers"]
    ends = {gltf["accessors"][sampler["input"]]["max"][0] for sampler in samplers}
    assert all(0.9 < end < 1.3 for end in ends)


def test_a_recorded_session_from_its_beginning(client):
    """A person that comes later stands in its first frame until then."""
    with client.create_session(record=True) as session:
        session.create_agents(wf.AgentSpec(name="Ada"))
        time.sleep(1.0)
        session.create_agents(wf.AgentSpec(name="Bob", gender="male", position=(-2, 0, 0)))
        time.sleep(1.0)
        first, later = starts(parts(session.export_motion(0, wf.MotionFile(detail="low")))[0])
    assert first == 0.0 and 0.5 < later < 3.0


def test_nobody_has_no_motion(client):
    with (
        client.create_session(record=True) as session,
        pytest.raises(wf.InvalidArgument, match="there is nobody"),
    ):
        session.export_motion()


def test_over_http(real_server):
    url = f"{real_server.url}/v1"
    request = {"seconds": 1, "agent": {"name": "A/b"}, "file": {"format": "vrma"}}
    made = httpx.post(f"{url}/clips", json=request)
    assert made.headers["content-type"] == "model/gltf-binary"
    assert made.headers["content-disposition"] == 'attachment; filename="A_b.vrma"'
    assert "VRMC_vrm_animation" in parts(made.content)[0]["extensionsUsed"]
    session = httpx.post(f"{url}/sessions", json={"record": True}).json()["session_id"]
    httpx.post(f"{url}/sessions/{session}/agents", json={"agents": [{}]})
    time.sleep(0.5)
    file = {"format": "bvh", "unit": "cm", "names": "ue"}
    made = httpx.post(f"{url}/sessions/{session}/motion", json={"file": file})
    assert made.text.startswith("HIERARCHY\nROOT pelvis")
    refused = httpx.post(f"{url}/sessions/{session}/motion", json={"file": {"format": "fbx"}})
    assert (refused.status_code, refused.json()["errors"][0]["field"]) == (422, "file.format")
    httpx.delete(f"{url}/sessions/{session}")
