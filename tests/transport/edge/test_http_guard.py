"""The checks before the HTTP routes, over a small application."""

import base64
import re
from hashlib import sha256

import pytest
from starlette.applications import Starlette
from starlette.responses import JSONResponse, PlainTextResponse
from starlette.routing import Route, WebSocketRoute
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from tests.transport.auth.test_keys import FILE, STUDIO
from wayfarer.config import sources
from wayfarer.endpoint import Endpoint
from wayfarer.errors import Unavailable
from wayfarer.runtime.stats import LoopStats
from wayfarer.transport.auth import Authenticator
from wayfarer.transport.auth.keys import KeyFile
from wayfarer.transport.edge.asgi import front
from wayfarer.transport.edge.call_rates import FAILURE_BURST, CallRates
from wayfarer.transport.edge.caller import current_caller
from wayfarer.transport.edge.guard import Guard
from wayfarer.transport.edge.origins import Origins
from wayfarer.transport.server_options import ServerOptions
from wayfarer.world.agents.agent import AgentState

STATS = LoopStats(*([0] * 9), states={AgentState.WALKING: 3})
ADMIN_ONLY = "wf_" + "a" * 43
DIGEST = sha256(ADMIN_ONLY.encode()).hexdigest()
ADMIN = f'[keys.root]\nsha256 = "{DIGEST}"\nscopes = ["admin"]'


async def whoami(request):
    return JSONResponse({"caller": current_caller().name})


async def echo(socket):
    await socket.accept()
    await socket.send_json(
        {"caller": current_caller().name, "offered": socket.scope["subprotocols"]}
    )
    await socket.close()


async def fail(request):
    raise RuntimeError("broken")


APP = Starlette(
    routes=[
        Route("/v1/me/{name}", whoami, methods=["GET", "POST"]),
        Route("/v1/fail", fail),
        Route("/v1/health/live", lambda request: PlainTextResponse("live")),
        Route("/index.html", lambda request: PlainTextResponse("viewer")),
        WebSocketRoute("/v1/stream", echo),
    ]
)


def guarded(tmp_path, per_second: int = 1000) -> Guard:
    path = tmp_path / "keys.toml"
    path.write_text(
        FILE.replace("calls_per_second = 5", f"calls_per_second = {per_second}") + ADMIN
    )
    return Guard(Authenticator(KeyFile(path)), CallRates(1000, clock=lambda: 0.0))


def client(operation: ServerOptions, stats=None, nodes=None, **options) -> TestClient:
    async def told() -> LoopStats:
        return STATS

    options = {"base_url": "http://localhost", **options}
    return TestClient(front(APP, operation, stats or told, nodes), **options)


@pytest.fixture
def operation(tmp_path):
    listed = Origins(frozenset({"https://app.example"}), names=None)
    return ServerOptions(guarded(tmp_path), listed)


@pytest.fixture
def http(operation):
    return client(operation)


KEY = {"x-api-key": STUDIO}


@pytest.mark.parametrize("path", ["/v1/health/live", "/index.html"])
def test_health_and_viewer_are_open(http, path):
    assert http.get(path).status_code == 200


@pytest.mark.parametrize(
    "path",
    [
        *("/v1/me/x", "/v1/nothing", "/v1/", "/metrics", "/v1%2Fme/x"),
    ],
)
def test_all_else_asks_who_calls(http, path):
    answer = http.get(path)
    assert answer.status_code == 401
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.headers["www-authenticate"].startswith("Bearer")
    assert "x-api-key" in answer.json()["detail"]


@pytest.mark.parametrize(
    "headers", [KEY, {"authorization": f"Bearer {STUDIO}"}, {"authorization": f"bearer  {STUDIO}"}]
)
def test_a_key_opens(http, headers):
    assert http.get("/v1/me/x", headers=headers).json() == {"caller": "key:studio"}


@pytest.mark.parametrize("value", ["Basic YTpi", "Bearer", "Bearer ", STUDIO])
def test_a_header_of_another_form_is_explained(http, value):
    answer = http.get("/v1/me/x", headers={"authorization": value})
    assert answer.status_code == 401
    assert "Bearer, a space" in answer.json()["detail"]


def test_a_caller_of_before_is_forgotten(http):
    http.get("/v1/me/x", headers=KEY)
    assert http.get("/v1/me/x").status_code == 401


def test_too_many_calls(tmp_path):
    http = client(ServerOptions(guarded(tmp_path, per_second=2)))
    answers = [http.get("/v1/me/x", headers=KEY) for _ in range(5)]
    assert [a.status_code for a in answers] == [200] * 4 + [429]
    assert answers[-1].headers["retry-after"] == "1"
    assert answers[-1].json()["retry_after_s"] <= 0.5


def test_too_many_wrong_keys_from_one_address_do_not_lock_out_the_right_ones(http):
    answers = [
        http.get("/v1/me/x", headers={"x-api-key": "wf_no"}) for _ in range(FAILURE_BURST + 1)
    ]
    assert [a.status_code for a in answers] == [401] * FAILURE_BURST + [429]
    assert http.get("/v1/me/x", headers=KEY).status_code == 200


def test_every_answer_has_a_request_id(http):
    own = http.get("/v1/me/x", headers={**KEY, "x-request-id": "walk-1"})
    assert own.headers["x-request-id"] == "walk-1"
    for bad in ("", "a b", "x" * 65, "<script>"):
        made = http.get("/v1/me/x", headers={"x-request-id": bad}).headers["x-request-id"]
        assert re.fullmatch("[0-9a-f]{16}", made)


# web pages


def test_pages_elsewhere_may_not_change_anything(http):
    page = {**KEY, "origin": "https://evil.example"}
    assert http.post("/v1/me/x", headers=page).status_code == 403
    answer = http.get("/v1/me/x", headers=page)
    assert answer.status_code == 200 and "access-control-allow-origin" not in answer.headers


@pytest.mark.parametrize(
    "origin",
    ["https://app.example", "http://localhost:5173", "http://127.0.0.1:80", "http://[::1]"],
)
def test_pages_that_are_listed_or_of_this_machine_may_and_read_the_answer(http, origin):
    page = {"origin": origin}
    asked = http.options(
        "/v1/me/x",
        headers={
            **page,
            "access-control-request-method": "POST",
            "access-control-request-headers": "authorization, content-type",
        },
    )
    assert asked.status_code == 200
    assert asked.headers["access-control-allow-origin"] == origin
    answer = http.post("/v1/me/x", headers={**KEY, **page})
    assert answer.headers["access-control-allow-origin"] == origin
    refused = http.post("/v1/me/x", headers=page)  # so that the page can read why
    assert refused.status_code == 401 and "access-control-allow-origin" in refused.headers


@pytest.mark.parametrize(
    "origin",
    [
        *("https://app.example", "http://localhost.evil.example", "http://evil@localhost"),
        *("http://notlocalhost", "http://127.0.0.1.evil.example", "null", "http://localhost/x"),
    ],
)
def test_without_a_list_no_page_from_elsewhere_reads_an_answer(origin):
    answer = client(ServerOptions()).options(
        "/v1/me/x", headers={"origin": origin, "access-control-request-method": "GET"}
    )
    assert "access-control-allow-origin" not in answer.headers


FOREIGN = {"host": "evil.example"}


@pytest.mark.parametrize("path", ["/v1/me/x", "/metrics", "/index.html", "/v1/nothing"])
def test_a_foreign_name_that_points_here_reads_nothing(path):
    answer = client(ServerOptions()).get(path, headers=FOREIGN)
    assert answer.status_code == 403
    assert (
        "'evil.example'" in answer.json()["detail"] and "allowed_hosts" in answer.json()["detail"]
    )


def test_a_foreign_name_that_points_here_changes_nothing():
    page = {**FOREIGN, "origin": "http://evil.example"}
    http = client(ServerOptions())
    assert http.post("/v1/me/x", headers=page).status_code == 403
    closed = closed_with(http, headers=page)
    assert closed.code == 4403 and "allowed_hosts" in closed.reason


def test_probes_may_call_by_any_name():
    assert client(ServerOptions()).get("/v1/health/live", headers=FOREIGN).status_code == 200


def test_names_that_are_listed_will_do():
    settings = sources.load({"allowed_hosts": ["Wayfarer"]})
    http = client(ServerOptions.from_settings(settings))
    assert http.get("/metrics", headers={"host": "wayfarer:8080"}).status_code == 200
    assert http.get("/metrics", headers=FOREIGN).status_code == 403


def test_where_credentials_are_asked_for_any_name_will_do(http):
    assert http.get("/v1/me/x", headers={**KEY, **FOREIGN}).status_code == 200


@pytest.mark.parametrize("path", ["/v1/health/live", "/index.html", "/v1/me/x"])
def test_answers_say_what_a_page_may_load_and_who_may_frame_it(http, path):
    for answer in (http.get(path), client(ServerOptions()).get(path)):
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy and "script-src 'self' 'wasm-unsafe-eval';" in policy
        assert answer.headers["x-frame-options"] == "SAMEORIGIN"
    assert policy.endswith("frame-ancestors 'self' http://localhost:* http://127.0.0.1:*")
    listed = http.get(path).headers["content-security-policy"]
    assert listed.endswith("frame-ancestors 'self' https://app.example")


# sockets


def offered(token: str) -> list[str]:
    text = base64.urlsafe_b64encode(token.encode()).decode().rstrip("=")
    return ["wayfarer.v1", "wayfarer.token." + text]


def closed_with(http: TestClient, **options) -> WebSocketDisconnect:
    with http.websocket_connect("/v1/stream", **options) as socket:
        with pytest.raises(WebSocketDisconnect) as caught:
            socket.receive_json()
        return caught.value


def test_a_page_sends_its_key_as_a_subprotocol(http):
    with http.websocket_connect("/v1/stream", subprotocols=offered(STUDIO)) as socket:
        assert socket.accepted_subprotocol == "wayfarer.v1"
        assert socket.receive_json() == {"caller": "key:studio", "offered": ["wayfarer.v1"]}


def test_a_program_sends_a_header(http):
    with http.websocket_connect("/v1/stream", headers=KEY) as socket:
        assert socket.accepted_subprotocol is None
        assert socket.receive_json()["caller"] == "key:studio"


@pytest.mark.parametrize(
    "subprotocols",
    [[], ["wayfarer.v1"], offered("wf_wrong"), ["wayfarer.token.***"], offered("é")],
)
def test_a_socket_without_credentials_is_told_why(http, subprotocols):
    closed = closed_with(http, subprotocols=subprotocols)
    assert closed.code == 4401 and closed.reason


def test_a_page_elsewhere_gets_no_socket(http):
    closed = closed_with(http, headers={**KEY, "origin": "https://evil.example"})
    assert (closed.code, "cors_origins" in closed.reason) == (4403, True)


def test_a_listed_page_gets_one(http):
    headers = {**KEY, "origin": "https://app.example"}
    with http.websocket_connect("/v1/stream", headers=headers) as socket:
        assert socket.receive_json()


# metrics


def test_metrics_need_the_scope_read(http):
    page = http.get("/metrics", headers=KEY)
    assert page.status_code == 200
    assert 'wayfarer_agents{state="walking"} 3.0' in page.text
    assert http.get("/metrics", headers={"x-api-key": ADMIN_ONLY}).status_code == 403


def test_metrics_open_and_off(tmp_path):
    guard = guarded(tmp_path)
    assert client(ServerOptions(guard, metrics_access="open")).get("/metrics").status_code == 200
    assert client(ServerOptions(guard, metrics_access="off")).get("/metrics").status_code == 404


def test_metrics_of_a_loop_that_has_ended():
    async def ended() -> LoopStats:
        raise Unavailable("ended")

    page = client(ServerOptions(), ended).get("/metrics")
    assert page.status_code == 200
    assert "wayfarer_step_seconds" in page.text and "wayfarer_sessions" not in page.text


def test_requests_are_counted_by_route_never_by_what_a_client_makes_up():
    operation = ServerOptions()
    http = client(operation, raise_server_exceptions=False)
    http.get("/v1/me/ada")
    http.get("/v1/me/bob")
    http.get("/v1/made/up")
    http.request("BREW", "/v1/me/ada")
    http.get("/v1/fail")
    with http.websocket_connect("ws://localhost/v1/stream") as socket:
        socket.receive_json()
    page = http.get("/metrics").text
    assert "me/ada" not in page and "up" not in re.findall(r'route="([^"]*)"', page)
    assert "BREW" not in page
    count = operation.metrics.registry.get_sample_value
    labels = {"method": "GET", "route": "other", "status": "404"}
    assert count("wayfarer_http_seconds_count", labels) == 1
    failed = [line for line in page.splitlines() if 'status="500"' in line and "_count" in line]
    assert len(failed) == 1 and failed[0].endswith(" 1.0")


# Pages of the other nodes of a cluster

NODES = (Endpoint(0, 1, 8081), Endpoint(1, 2, 8082, "node-b"), Endpoint(2, 3, 8083, "::1"))
ASKS = {"access-control-request-method": "POST", "access-control-request-headers": "content-type"}


@pytest.fixture
def node(tmp_path):
    origins = Origins(nodes=("*.later.example",))
    return client(ServerOptions(guarded(tmp_path), origins), nodes=lambda: NODES)


@pytest.mark.parametrize(
    "origin",
    [
        *("http://localhost:8081", "https://node-b:8082", "http://[::1]:8083"),
        *("http://node-b", "http://node-b:8081", "http://n7.later.example:9000"),
    ],
)
def test_pages_of_a_clusters_machines_may_call_and_read(node, origin):
    asked = node.options("/v1/me/x", headers={"origin": origin, **ASKS})
    assert asked.status_code == 200
    assert asked.headers["access-control-allow-origin"] == origin
    answer = node.post("/v1/me/x", headers={"origin": origin, **KEY})
    assert answer.status_code != 403
    assert answer.headers["access-control-allow-origin"] == origin
    assert node.get("/v1/me/x", headers={"origin": origin}).status_code == 401, "a key all the same"


@pytest.mark.parametrize(
    "origin",
    [
        *("http://node-b.evil:8082", "http://evil@node-b:8082", "ftp://node-b:8082"),
        *("node-b:8082", "null", "http://evil:8081", "http://node-b:8082/x", "http://node-b:"),
        *("http://later.example", "http://evil-later.example", "http://later.example.evil:80"),
        *("http://evil@n7.later.example", "http://evil/.later.example", "http://*.later.example"),
    ],
)
def test_and_no_others(node, origin):
    asked = node.options("/v1/me/x", headers={"origin": origin, **ASKS})
    assert "access-control-allow-origin" not in asked.headers
    answer = node.post("/v1/me/x", headers={"origin": origin, **KEY})
    assert answer.status_code == 403
    assert "access-control-allow-origin" not in answer.headers


def test_a_page_may_call_the_clusters_machines_and_nothing_else(node, http):
    policy = node.get("/index.html").headers["content-security-policy"]
    called = (
        "connect-src 'self' localhost:8081 node-b:8082 [::1]:8083 "
        "localhost:* node-b:* [::1]:* *.later.example:* ws: wss: data: blob:;"
    )
    assert called in policy
    for answer in (node.get("/v1/me/x", headers=KEY), http.get("/index.html")):
        assert "connect-src 'self' ws:" in answer.headers["content-security-policy"]
