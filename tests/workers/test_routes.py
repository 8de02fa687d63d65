import pytest

from wayfarer.service.persistence.container import ContainerKind as Container
from wayfarer.service.persistence.container import seal
from wayfarer.v1 import (
    admin_pb2,
    control_pb2,
    goal_pb2,
    motion_pb2,
    scene_pb2,
    session_pb2,
    snapshot_pb2,
)
from wayfarer.workers.routes import METHODS, RouteKind, http_kind, http_worker

# of worker 2 of 5; fixed, since parametrized tests need the same names in every process
SESSION, SCENE = "session-35b8bb18b6d57bb7", "scene-6cfe141cc4da068c"
AGENT = "agent-35b81c099b4977b6"
SNAPSHOT = seal(
    Container.SNAPSHOT, b'{"fps":40,"session":{"session_id":"%s"}}' % SESSION.encode(), b""
)


class Fixed:
    def __init__(self) -> None:
        self.requests: list[str] = []

    def choose(self, request_id: str = "") -> int:
        self.requests.append(request_id)
        return 4

    def any(self) -> int:
        return 3

    def find(self, name: str) -> int:
        return {SESSION: 2, AGENT: 2, SCENE: 2}.get(name, 0)


def kinds() -> dict[str, RouteKind]:
    return {path.rpartition("/")[2]: method.kind for path, method in METHODS.items()}


def test_every_method_goes_somewhere_sensible():
    found = kinds()
    assert {n for n, k in found.items() if k is RouteKind.NEW} == {
        "CreateSession",
        "CreateScene",
        "CreateMeshScene",
        "CreateExampleScene",
    }
    assert {n for n, k in found.items() if k is RouteKind.IMPORT} == {"ImportSession"}
    everywhere = {"ListSessions", "ListScenes", "LoadModel", "UseModel", "UnloadModel", "Drain"}
    assert {n for n, k in found.items() if k is RouteKind.ALL} == everywhere
    anywhere = {
        "GetSkeleton",
        "ListExampleScenes",
        "ListBodies",
        "FitBody",
        "ListModels",
        "GetServerInfo",
        "GenerateClip",
        "Replay",
    }
    assert {n for n, k in found.items() if k is RouteKind.ANY} == anywhere
    assert len([k for k in found.values() if k is RouteKind.NAMED]) == len(found) - 19


@pytest.mark.parametrize(
    "request_",
    [
        session_pb2.GetSessionRequest(session_id=SESSION),
        goal_pb2.SetGoalRequest(agent_id=AGENT),
        session_pb2.CreateSessionRequest(scene=SCENE, request_id="r"),
        scene_pb2.QueryPathRequest(scene_id=SCENE),
        scene_pb2.PopulateSessionRequest(session_id=SESSION),
        motion_pb2.StreamMotionRequest(session_id=SESSION),
        control_pb2.ControlRequest(open={"session_id": SESSION}),
        snapshot_pb2.ImportSessionRequest(snapshot=SNAPSHOT),
    ],
    ids=lambda message: type(message).__name__,
)
def test_grpc_calls_go_to_the_worker_of_whom_they_name(request_):
    (method,) = (m for m in METHODS.values() if m.request.DESCRIPTOR == request_.DESCRIPTOR)
    assert method.worker(request_.SerializeToString(), Fixed()) == 2


def test_a_new_session_is_placed_by_its_request_id():
    placement = Fixed()
    method = METHODS["/wayfarer.v1.SessionService/CreateSession"]
    data = session_pb2.CreateSessionRequest(request_id="r").SerializeToString()
    assert method.worker(data, placement) == 4
    assert http_worker("POST", "/v1/sessions", "", "", b'{"request_id": "s"}', placement) == 4
    assert http_worker("POST", "/v1/sessions", "", "key", b"", placement) == 4
    assert http_worker("POST", "/v1/sessions", "", "key", b"[not json", placement) == 4
    assert http_worker("POST", "/v1/sessions", "", "key", b'{"request_id": [1]}', placement) == 4
    assert placement.requests == ["r", "s", "key", "key", "key"]


def test_a_session_goes_where_its_scene_is_and_a_mesh_by_its_request_id():
    placement = Fixed()
    body = b'{"scene": "%s", "request_id": "r"}' % SCENE.encode()
    assert http_worker("POST", "/v1/sessions", "", "", body, placement) == 2
    assert placement.requests == []
    http_worker("POST", "/v1/scenes/mesh", "format=obj&request_id=m", "", b"", placement)
    http_worker("POST", "/v1/scenes/mesh", "", "key", b"", placement)
    header = scene_pb2.CreateMeshSceneRequest(header={"scene": {"request_id": "n"}})
    method = METHODS["/wayfarer.v1.SceneService/CreateMeshScene"]
    assert method.worker(header.SerializeToString(), placement) == 4
    assert placement.requests == ["m", "key", "n"]


def test_what_cannot_be_read_goes_somewhere_to_be_refused():
    assert METHODS["/wayfarer.v1.SessionService/GetSession"].worker(b"\xff", Fixed()) == 3
    damaged = snapshot_pb2.ImportSessionRequest(snapshot=SNAPSHOT[:20]).SerializeToString()
    assert METHODS["/wayfarer.v1.SnapshotService/ImportSession"].worker(damaged, Fixed()) == 0
    assert METHODS["/wayfarer.v1.AdminService/Drain"].request is admin_pb2.DrainRequest


@pytest.mark.parametrize(
    ("method", "path", "query", "worker"),
    [
        ("GET", f"/v1/sessions/{SESSION}", "", 2),
        ("POST", f"/v1/sessions/{SESSION}/agents", "", 2),
        ("PUT", f"/v1/agents/{AGENT}/goal", "expected_revision=1", 2),
        ("GET", f"/v1/scenes/{SCENE}", "", 2),
        ("PUT", f"/v1/scenes/{SCENE}/obstacles/mesh", "", 2),
        ("POST", f"/v1/scenes/{SCENE}/path", "", 2),
        ("GET", "/v1/scenes/examples", "", 3),
        ("POST", "/v1/scenes", "", 4),
        ("POST", "/v1/scenes/mesh", "", 4),
        ("POST", "/v1/scenes/examples/corridor", "", 4),
        ("GET", "/v1/events", f"agent=x&session={SESSION}", 2),
        ("GET", "/v1/events", "", 0),
        ("POST", "/v1/clips", "", 3),
        ("GET", "/v1/info", "", 3),
        ("GET", "/people.js", "", 3),
        ("OPTIONS", "/v1/sessions", "", 3),
    ],
)
def test_http_requests_go_where_they_belong(method, path, query, worker):
    assert http_worker(method, path, query, "", b"", Fixed()) == worker


def test_an_imported_session_goes_where_its_id_says():
    assert http_worker("POST", "/v1/snapshots", "", "", SNAPSHOT, Fixed()) == 2


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/v1/sessions"),
        ("GET", "/v1/scenes"),
        ("GET", "/v1/stats"),
        ("POST", "/v1/admin/models"),
        ("POST", "/v1/admin/models/v2/use"),
        ("DELETE", "/v1/admin/models/v2"),
        ("POST", "/v1/admin/drain"),
    ],
)
def test_what_concerns_all_is_asked_of_all(method, path):
    assert http_kind(method, path) is RouteKind.ALL
