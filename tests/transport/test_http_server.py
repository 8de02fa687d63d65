"""HTTP, called by a real client."""

import base64
import gzip
import json
import posixpath
import re

import pytest

from wayfarer.errors import ResourceExhausted


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
        ("POST", "/v1/sessions", {"seed": "1"}, 422),
        ("POST", "/v1/sessions", {"seed": True}, 422),
        ("POST", "/v1/sessions", {"seed": 1.5}, 422),
        ("POST", "/v1/sessions", {"seed": -1}, 422),
        ("POST", "/v1/sessions", {"lease_s": 0.5}, 422),
        ("POST", "/v1/sessions", {"lock_step": "yes"}, 422),
        ("POST", "/v1/sessions", {"scene": "park"}, 404),
        ("POST", "/v1/clips", {}, 422),
        ("POST", "/v1/clips", {"seconds": 0}, 422),
        ("PATCH", "/v1/agents/none", {"name": "a\nb"}, 422),
        ("PATCH", "/v1/agents/none", {"betas": []}, 422),
        ("GET", "/v1/events", None, 422),
        ("GET", "/v1/events?session=none", None, 404),
        ("GET", "/v1/events?session=none&resume_token=7", None, 404),
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


@pytest.mark.parametrize("coding", ["gzip", "br", "identity, gzip", "made-up"])
async def test_a_compressed_body_is_refused(rig, coding):
    packed = gzip.compress(b"{}")
    answer = await rig.http.post(
        "/v1/sessions", content=packed, headers={"content-encoding": coding}
    )
    assert answer.status_code == 415 and answer.headers["accept-encoding"] == "identity"
    assert answer.json()["type"] == "about:blank" and "identity" in answer.json()["detail"]


async def test_a_body_that_says_it_is_not_compressed_is_taken(rig):
    headers = {"content-encoding": "Identity", "content-type": "application/json"}
    answer = await rig.http.post("/v1/sessions", content=b"{}", headers=headers)
    assert answer.status_code == 201


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
    answer = await rig.http.get("/v1/bodies/" + path)
    assert answer.status_code == status
    if "betas" in path:
        assert answer.json()["detail"].startswith("betas: must be 10 numbers between -10 and 10")


@pytest.mark.parametrize(
    ("method", "path", "known"),
    [
        ("PUT", "/v1/agents/{agent}/goal?expected=7", "did you mean expected_revision?"),
        ("DELETE", "/v1/agents/{agent}/goal?expected=7", "did you mean expected_revision?"),
        ("POST", "/v1/replays?speed=2", "known are encoding, profile, bones, fps"),
        ("POST", "/v1/scenes/mesh?unti=0.01", "did you mean unit?"),
        ("GET", "/v1/sessions?limit=5", "there are none"),
    ],
)
async def test_an_unknown_name_in_the_query_is_refused(rig, method, path, known):
    _, (agent, _) = await rig.session()
    path = path.format(agent=agent["agent_id"])
    body = {"position": {"x": 0, "y": 0, "z": 1}} if method == "PUT" else None
    answer = await rig.http.request(method, path, json=body)
    assert answer.status_code == 422 and rig.service.commands == []
    name = path.partition("?")[2].partition("=")[0]
    assert answer.json()["errors"] == [{"field": name, "detail": f"unknown; {known}"}]
    assert answer.json()["detail"] == f"{name}: unknown; {known}"


@pytest.mark.parametrize("path", ["/v1/health/live", "/v1/health/ready", "/docs/", "/"])
async def test_probes_and_pages_take_any_query(rig, path):
    assert (await rig.http.get(f"{path}?v=7")).status_code == 200


@pytest.mark.parametrize("kind", ["none", "text/plain", "application/x-www-form-urlencoded"])
async def test_a_body_that_is_not_said_to_be_json_is_refused(rig, kind):
    headers = {} if kind == "none" else {"content-type": kind}
    for path in ("/v1/sessions", "/v1/sessions/none/agents"):
        answer = await rig.http.post(path, content=b'{"agents": [{}]}', headers=headers)
        assert answer.status_code == 422
        assert answer.json()["detail"] == f"send content-type: application/json, not {kind}"


async def test_what_a_body_has_to_be_is_told(rig):
    path = "/v1/sessions/none/agents"
    for body, told in (
        ({}, "a JSON body is needed; send content-type: application/json"),
        ({"json": None}, "a JSON body is needed; send content-type: application/json"),
        ({"json": [1]}, "the body must be an object, not a list"),
        ({"json": {"agent": []}}, "agents: is needed; agent: unknown; did you mean agents?"),
    ):
        assert (await rig.http.post(path, **body)).json()["detail"] == told


async def test_a_page_and_all_it_imports_are_kept_by_the_browser(rig):
    page = await rig.http.get("/")
    links = re.findall(r'(?:href|src)="(kept/[^"]+)"', page.text)
    scripts = [link for link in links if link.endswith(".js")]
    assert any(link.endswith("client/core/player.js") for link in scripts)
    for link in links:
        file = await rig.http.get(f"/{link}")
        assert file.status_code == 200 and "immutable" in file.headers["cache-control"]
        assert file.headers["content-encoding"] == "gzip"  # and httpx has unpacked it
        if "/vendor/" in link:
            continue
        for name in re.findall(r'^(?:import|export)\b[^;"]*"(\.[^"]+)";', file.text, re.M):
            imported = posixpath.normpath(posixpath.join(posixpath.dirname(link), name))
            assert imported in links
    plain = await rig.http.get(f"/{links[0]}", headers={"accept-encoding": "identity"})
    assert "content-encoding" not in plain.headers and "immutable" in plain.headers["cache-control"]
    old = await rig.http.get("/kept/of-another-version/main.js")
    assert old.status_code == 200 and old.headers["cache-control"] == "no-cache"
    assert (await rig.http.get("/kept/x/..%2f..%2fapp.py")).status_code == 404


async def test_viewer_is_served_and_revalidated(rig):
    page = await rig.http.get("/")
    assert page.status_code == 200 and page.headers["content-type"].startswith("text/html")
    assert page.headers["cache-control"] == "no-cache"
    again = await rig.http.get("/", headers={"if-none-match": page.headers["etag"]})
    assert again.status_code == 304
    script = await rig.http.get("/main.js")
    assert script.headers["content-type"].startswith("text/javascript")
    assert (await rig.http.get("/..%2f..%2f__init__.py")).status_code == 404


async def test_http_keeps_sessions(rig):
    made = await rig.http.post("/v1/sessions")  # all has a default
    assert made.status_code == 201
    session = made.json()
    assert session["basis"]["basis"] == "gltf" and session["lease_s"] == 60
    path = f"/v1/sessions/{session['session_id']}"
    assert (await rig.http.get(path)).json() == session
    assert (await rig.http.get("/v1/sessions")).json() == {"sessions": [session]}
    renewal = (await rig.http.post(path + "/renew")).json()
    assert renewal == {"expires_at_us": session["expires_at_us"]}  # the clock stands still


async def test_a_header_names_a_request_that_may_be_sent_again(rig):
    key = {"idempotency-key": "one"}
    first = await rig.http.post("/v1/sessions", headers=key, json={"seed": 1})
    again = await rig.http.post("/v1/sessions", json={"seed": 1, "request_id": "one"})
    assert again.json() == first.json()
    other = await rig.http.post("/v1/sessions", headers=key, json={"seed": 2})
    assert other.status_code == 409 and other.json()["type"] == "urn:wayfarer:aborted"
    both = await rig.http.post("/v1/sessions", headers=key, json={"request_id": "two"})
    assert both.status_code == 422 and "Idempotency-Key" in both.json()["detail"]
    agents = f"/v1/sessions/{first.json()['session_id']}/agents"
    for _ in range(2):
        await rig.http.post(agents, headers={"idempotency-key": "b"}, json={"agents": [{}]})
    assert rig.service.created == 2


async def test_http_changes_agents(rig):
    _, (agent, _) = await rig.session()
    path = f"/v1/agents/{agent['agent_id']}"
    changed = await rig.http.patch(path, json={"name": "Ada", "foot_lock": False})
    assert (changed.json()["name"], changed.json()["foot_lock"]) == ("Ada", False)
    for wrong in (-1, 1 << 32, "x"):
        answer = await rig.http.delete(path + "/goal", params={"expected_revision": wrong})
        assert answer.status_code == 422
        assert answer.json()["errors"][0]["field"] == "expected_revision"


async def test_a_clip_is_lines_of_json(rig):
    agent = {"seed": 3, "position": {"x": 0, "y": 0, "z": 1}}
    pose_format = {"encoding": "smallest_three"}
    request = {"seconds": 0.4, "agent": agent, "basis": "unity", "format": pose_format}
    answer = await rig.http.post("/v1/clips", json=request)
    assert answer.headers["content-type"] == "application/x-ndjson"
    header, *batches = map(json.loads, answer.text.splitlines())
    assert list(header) == ["header"] and all(list(line) == ["batch"] for line in batches)
    assert header["header"]["pose_encoding"] == "smallest_three"
    chunks = [line["batch"]["chunks"] for line in batches]
    assert [chunk["seqs"] for chunk in chunks] == [[0], [1]]
    assert chunks[0]["states"] == ["standing"]
    frames = len(base64.b64decode(chunks[0]["poses"])) // header["header"]["frame_bytes"]
    assert frames == len(base64.b64decode(chunks[0]["contacts"])) == 8
    added = batches[0]["batch"]["added"][0]
    assert (added["seed"], added["position"]["z"]) == (3, 1.0)
    assert not header["header"]["basis"]["right_handed"]


async def test_a_clip_that_breaks_off_says_why(rig):
    rig.service.fail_with = ResourceExhausted("no room", 2.0)
    answer = await rig.http.post("/v1/clips", json={"seconds": 0.4})
    assert answer.status_code == 200
    last = json.loads(answer.text.splitlines()[-1])
    assert list(last) == ["problem"]
    assert last["problem"]["status"] == 429 and last["problem"]["retry_after_s"] == 2.0


async def test_http_lets_time_pass(rig):
    session = (await rig.http.post("/v1/sessions", json={"lock_step": True})).json()
    path = f"/v1/sessions/{session['session_id']}"
    await rig.http.post(path + "/agents", json={"agents": [{}]})
    first = (await rig.http.post(path + "/step")).json()
    assert len(first["batches"]) == 1 and first["batches"][0]["added"]
    more = (await rig.http.post(path + "/step", json={"steps": 3, "format": {"fps": 10}})).json()
    assert [batch["chunks"]["seqs"] for batch in more["batches"]] == [[1], [2], [3]]
    assert len(base64.b64decode(more["batches"][0]["chunks"]["contacts"])) == 2


async def test_http_moves_and_replays_sessions(rig):
    session = (await rig.http.post("/v1/sessions", json={"record": True})).json()
    path = f"/v1/sessions/{session['session_id']}"
    snapshot = await rig.http.get(path + "/snapshot")
    assert snapshot.headers["content-type"] == "application/octet-stream"
    log = (await rig.http.get(path + "/log")).content
    assert (await rig.http.post("/v1/snapshots", content=snapshot.content)).status_code == 409
    await rig.http.delete(path)
    back = await rig.http.post("/v1/snapshots", content=snapshot.content)
    assert back.status_code == 201 and back.json()["session_id"] == session["session_id"]
    assert (await rig.http.post("/v1/snapshots", content=b"?")).status_code == 422
    query = {"profile": "bones", "bones": ["head", "neck"], "fps": 20}
    lines = (await rig.http.post("/v1/replays", content=log, params=query)).text.splitlines()
    assert json.loads(lines[0])["header"]["frame_bytes"] == 12 + 2 * 16 and len(lines) == 3
    assert (await rig.http.post("/v1/replays", content=b"?")).status_code == 422
    for wrong in ({"fps": -1}, {"fps": 30}, {"bones": ["head"]}, {"encoding": "jpeg"}):
        answer = await rig.http.post("/v1/replays", content=log, params=wrong)
        assert answer.status_code == 422
        assert answer.json()["errors"][0]["field"].endswith(next(iter(wrong)))


async def test_http_administrates(rig):
    await rig.session()
    loaded = await rig.http.post("/v1/admin/models", json={"name": "next"})
    assert loaded.status_code == 201 and not loaded.json()["in_use"]
    for body, moved in (({}, 0), ({"move_agents": True}, 2)):
        answer = await rig.http.post("/v1/admin/models/next/use", json=body)
        assert answer.json() == {"moved": moved}
    assert (await rig.http.delete("/v1/admin/models/next")).status_code == 409
    assert (await rig.http.delete("/v1/admin/models/fake")).status_code == 204
    (left,) = (await rig.http.get("/v1/models")).json()["models"]
    assert (left["name"], left["in_use"]) == ("next", True)
    assert (await rig.http.post("/v1/admin/models", json={"name": "../x"})).status_code == 422
    assert (await rig.http.post("/v1/admin/models", json={"name": "broken"})).status_code == 409
    assert (await rig.http.post("/v1/admin/drain")).status_code == 202


@pytest.mark.parametrize(
    ("method", "path", "allowed"),
    [
        ("PUT", "/v1/sessions/x", "DELETE, GET"),
        ("GET", "/v1/clips", "POST"),
        ("OPTIONS", "/v1/sessions", "GET, POST"),
        ("HEAD", "/v1/info", "GET"),
        ("POST", "/v1/bodies/anny52-male.glb", "GET"),
    ],
)
async def test_a_path_says_which_methods_it_has(rig, method, path, allowed):
    answer = await rig.http.request(method, path)
    assert answer.status_code == 405 and answer.headers["allow"] == allowed
    assert answer.headers["content-type"] == "application/problem+json"


async def test_a_body_that_is_not_text_is_refused(rig):
    headers = {"content-type": "application/json"}
    for body in (b"\xff\xfe", b"\x80", b"{"):
        answer = await rig.http.post("/v1/sessions", content=body, headers=headers)
        assert answer.status_code == 422 and "body is not JSON" in answer.json()["detail"]


async def test_a_whole_number_may_be_written_with_a_fraction_of_nothing(rig):
    for seed, status in ((b"318.0", 201), (b"318.5", 422), (b"1e400", 422), (b'"318"', 422)):
        made = await rig.http.post(
            "/v1/sessions",
            content=b'{"seed": ' + seed + b"}",
            headers={"content-type": "application/json"},
        )
        assert made.status_code == status, made.text
        assert status == 422 or made.json()["seed"] == 318
