"""Models that come and go in the real process, with the shipped one as old and new."""

import asyncio
import shutil
import time

import httpx
import numpy as np
import pytest

import wayfarer_client as wf
from tests.fuzz.server import served
from tests.integration.test_process import ANY_PORTS, refused
from tests.serving import LIGHT
from wayfarer.model_bundle import DEFAULT_MODEL

OLD = DEFAULT_MODEL.name


@pytest.fixture
def folder(tmp_path):
    """`v2` is sound, `broken` has a changed file, and `lacking` lacks one."""
    models = tmp_path / "models"
    for name in ("v2", "broken", "lacking"):
        shutil.copytree(DEFAULT_MODEL, models / name)
    graph = models / "broken" / "step_male.onnx"
    graph.write_bytes(graph.read_bytes()[:-1] + b"?")
    (models / "lacking" / "weights.bin").unlink()
    return models


def test_a_wrong_hash_keeps_the_server_from_starting(folder):
    said = refused(*ANY_PORTS, "--model", str(folder / "broken"))
    assert "broken/step_male.onnx: sha256: found '" in said and "', expected '" in said


async def test_models_change_while_people_walk(folder, tmp_path):
    async with (
        asyncio.timeout(180),
        served(tmp_path / "log", settings=LIGHT | {"WAYFARER_MODELS_DIR": str(folder)}) as server,
        httpx.AsyncClient(base_url=f"{server.target.http}/v1", timeout=60) as http,
        wf.Client(server.target.grpc) as client,
    ):
        session = await furnish(client)
        stream = session.stream()
        before = await read(stream, 1.0)

        await check_refusals(http)
        assert await models(http) == {OLD: True}
        made = await http.post("/admin/models", json={"name": "v2"})
        assert made.status_code == 201, made.text
        assert await models(http) == {OLD: True, "v2": False}
        assert (await http.post("/admin/models", json={"name": "v2"})).status_code == 409

        used = await http.post("/admin/models/v2/use", json={"move_agents": True})
        assert used.json() == {"moved": 2}
        assert await models(http) == {OLD: False, "v2": True}
        agents = (await http.get(f"/sessions/{session.session_id}/agents")).json()["agents"]
        assert [agent["model"] for agent in agents] == ["v2", "v2"]
        assert (await http.delete(f"/admin/models/{OLD}")).status_code == 204
        assert (await http.delete("/admin/models/v2")).status_code == 409
        after = await read(stream, 1.5)

        batches = before + after
        changes = [e for batch in batches for e in batch.events if e.kind == "model_changed"]
        assert len({event.agent.agent_id for event in changes}) == len(changes) == 2
        assert all("'v2'" in event.detail for event in changes)
        for agent in agents:
            own = [f for b in batches for f in b.frames if f.agent.agent_id == agent["agent_id"]]
            assert_walks_on(own)
        assert server.errors == []


async def furnish(client: wf.Client) -> wf.Session:
    """A session of two people who walk far."""
    session = await client.create_session()
    people = await session.create_agents(wf.AgentSpec(seed=1), wf.AgentSpec(gender="male", seed=2))
    for agent in people:
        await session.set_goal(agent, (0.0, 0.0, 60.0))
    return session


async def check_refusals(http: httpx.AsyncClient) -> None:
    """Models that cannot be loaded, and why."""
    for name, status, why in (
        ("broken", 409, "step_male.onnx: sha256: found"),
        ("lacking", 409, "weights.bin: cannot be read"),
        ("nowhere", 404, "there are broken, gamma-anny52, lacking, v2"),
        ("../models/v2", 422, "name"),
        (OLD, 409, "loaded already"),
    ):
        answer = await http.post("/admin/models", json={"name": name})
        assert (answer.status_code, why in answer.text) == (status, True), answer.text


async def models(http: httpx.AsyncClient) -> dict[str, bool]:
    """Names of loaded models, and whether each is in use."""
    answer = (await http.get("/models")).json()
    return {model["name"]: model["in_use"] for model in answer["models"]}


async def read(stream: wf.MotionStream, seconds: float) -> list[wf.Batch]:
    """The frames that come within `seconds`."""
    until, got = time.monotonic() + seconds, []
    while time.monotonic() < until:
        got.append(await anext(stream))
    return got


def assert_walks_on(frames: list[wf.Frames]) -> None:
    """No chunk is missing, and the hips move no farther per frame than people's do."""
    assert [f.seq for f in frames] == list(range(frames[0].seq, frames[0].seq + len(frames)))
    hips = np.concatenate([f.translation for f in frames])
    assert np.linalg.norm(np.diff(hips, axis=0), axis=-1).max() < 0.1  # metres in 25 ms
    assert hips[-1, 2] - hips[0, 2] > 0.5
