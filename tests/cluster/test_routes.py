import pytest

from wayfarer.cluster.routes import METHODS, grpc_subject, http_is_for_all, http_subject
from wayfarer.runtime.persistence.container import ContainerKind as Container
from wayfarer.runtime.persistence.container import seal
from wayfarer.transport.contract import CALLS
from wayfarer.v1 import (
    control_pb2,
    goal_pb2,
    motion_pb2,
    scene_pb2,
    session_pb2,
    snapshot_pb2,
)
from wayfarer.v1.options_pb2 import CallOptions

# fixed, since parametrized tests need the same names in every process
SESSION, SCENE = "session-35b8bb18b6d57bb7", "scene-6cfe141cc4da068c"
AGENT = "agent-35b81c099b4977b6"
SNAPSHOT = seal(
    Container.SNAPSHOT, b'{"fps":40,"session":{"session_id":"%s"}}' % SESSION.encode(), b""
)


def test_every_method_goes_somewhere_sensible():
    found: dict[int, set[str]] = {}
    for call in CALLS.values():
        found.setdefault(call.options.routing, set()).add(call.name)
    assert found[CallOptions.ROUTING_NEW] == {
        "CreateSession",
        "CreateScene",
        "CreateMeshScene",
        "CreateExampleScene",
    }
    assert found[CallOptions.ROUTING_IMPORT] == {"ImportSession"}
    everywhere = {"ListSessions", "ListScenes", "LoadModel", "UseModel", "UnloadModel", "Drain"}
    assert found[CallOptions.ROUTING_ALL] == everywhere
    named = found[CallOptions.ROUTING_UNSPECIFIED]
    assert {n for n in named if grpc_subject(CALLS[n], b"") == ("any", "")} == {
        "GetSkeleton",
        "ListExampleScenes",
        "ListBodies",
        "FitBody",
        "ListModels",
        "GetServerInfo",
        "GenerateClip",
        "Replay",
    }


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
def test_grpc_calls_are_about_whom_they_name(request_):
    (method,) = (m for m in METHODS.values() if m.request.DESCRIPTOR == request_.DESCRIPTOR)
    kind, name = grpc_subject(method, request_.SerializeToString())
    assert kind == "named" and name in (SESSION, SCENE, AGENT)


def test_a_new_session_is_known_by_its_request_id():
    method = METHODS["/wayfarer.v1.SessionService/CreateSession"]
    data = session_pb2.CreateSessionRequest(request_id="r").SerializeToString()
    assert grpc_subject(method, data) == ("new", "r")
    for body, known in (
        (b'{"request_id": "s"}', "s"),
        (b"", "key"),
        (b"[not json", "key"),
        (b'{"request_id": [1]}', "key"),
    ):
        assert http_subject("POST", "/v1/sessions", "", "key", body) == ("new", known)


def test_a_session_goes_where_its_scene_is_and_a_mesh_by_its_request_id():
    body = b'{"scene": "%s", "request_id": "r"}' % SCENE.encode()
    assert http_subject("POST", "/v1/sessions", "", "", body) == ("named", SCENE)
    query = "format=obj&request_id=m"
    assert http_subject("POST", "/v1/scenes/mesh", query, "", b"") == ("new", "m")
    assert http_subject("POST", "/v1/scenes/mesh", "", "key", b"") == ("new", "key")
    header = scene_pb2.CreateMeshSceneRequest(header={"scene": {"request_id": "n"}})
    method = METHODS["/wayfarer.v1.SceneService/CreateMeshScene"]
    assert grpc_subject(method, header.SerializeToString()) == ("new", "n")


def test_what_cannot_be_read_goes_somewhere_to_be_refused():
    method = METHODS["/wayfarer.v1.SessionService/GetSession"]
    assert grpc_subject(method, b"\xff") == ("any", "")
    damaged = snapshot_pb2.ImportSessionRequest(snapshot=SNAPSHOT[:20]).SerializeToString()
    method = METHODS["/wayfarer.v1.SnapshotService/ImportSession"]
    assert grpc_subject(method, damaged)[0] == "named"


@pytest.mark.parametrize(
    ("method", "path", "query", "about"),
    [
        ("GET", f"/v1/sessions/{SESSION}", "", ("named", SESSION)),
        ("POST", f"/v1/sessions/{SESSION}/agents", "", ("named", SESSION)),
        ("PUT", f"/v1/agents/{AGENT}/goal", "expected_revision=1", ("named", AGENT)),
        ("GET", f"/v1/scenes/{SCENE}", "", ("named", SCENE)),
        ("PUT", f"/v1/scenes/{SCENE}/obstacles/mesh", "", ("named", SCENE)),
        ("POST", f"/v1/scenes/{SCENE}/path", "", ("named", SCENE)),
        ("GET", "/v1/scenes/examples", "", ("any", "")),
        ("POST", "/v1/scenes", "", ("new", "")),
        ("POST", "/v1/scenes/mesh", "", ("new", "")),
        ("POST", "/v1/scenes/examples/corridor", "", ("new", "")),
        ("GET", "/v1/events", f"agent=x&session={SESSION}", ("named", SESSION)),
        ("GET", "/v1/events", "", ("named", "")),
        ("POST", "/v1/clips", "", ("any", "")),
        ("GET", "/v1/info", "", ("any", "")),
        ("GET", "/people.js", "", ("any", "")),
        ("OPTIONS", "/v1/sessions", "", ("any", "")),
    ],
)
def test_http_requests_are_about_whom_they_name(method, path, query, about):
    assert http_subject(method, path, query, "", b"") == about


def test_an_imported_session_goes_where_its_id_says():
    assert http_subject("POST", "/v1/snapshots", "", "", SNAPSHOT) == ("named", SESSION)


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
    assert http_is_for_all(method, path)
