from pathlib import Path

import grpc
import pytest
from google.rpc.error_details_pb2 import (
    BadRequest,
    ErrorInfo,
    QuotaFailure,
    ResourceInfo,
    RetryInfo,
)
from google.rpc.status_pb2 import Status

from wayfarer import errors as raised
from wayfarer.endpoint import Endpoint
from wayfarer.transport import errors, schema

DOCUMENT = Path(__file__).parents[2] / "docs" / "errors.md"

EVERY = {
    raised.InvalidArgument("too big", "goal.radius"): ("INVALID_ARGUMENT", 422),
    raised.NotFound("no agent 'x'"): ("NOT_FOUND", 404),
    raised.AlreadyExists("taken"): ("ALREADY_EXISTS", 409),
    raised.FailedPrecondition("not now"): ("FAILED_PRECONDITION", 409),
    raised.Unreachable("no way", (1.0, 2.0, 3.0)): ("UNREACHABLE", 409),
    raised.Misdirected("elsewhere", Endpoint(1, 50053, 8082, "b.example")): ("MISDIRECTED", 421),
    raised.Aborted("stale"): ("ABORTED", 409),
    raised.Unauthenticated("who?"): ("UNAUTHENTICATED", 401),
    raised.PermissionDenied("no"): ("PERMISSION_DENIED", 403),
    raised.ResourceExhausted("full", retry_after=2.5): ("RESOURCE_EXHAUSTED", 429),
    raised.Unavailable("starting"): ("UNAVAILABLE", 503),
    raised.ArtifactError("secret path"): ("INTERNAL", 500),
    ZeroDivisionError("secret"): ("INTERNAL", 500),
}


TWICE = dict.fromkeys(("MISDIRECTED", "UNREACHABLE"), "FAILED_PRECONDITION")


def rich(error) -> tuple[grpc.Status, Status]:
    status = errors.to_grpc(error)
    (value,) = (v for k, v in status.trailing_metadata if k == "grpc-status-details-bin")
    return status, Status.FromString(value)


def detail(status: Status, kind):
    for packed in status.details:
        if packed.Is(kind.DESCRIPTOR):
            found = kind()
            packed.Unpack(found)
            return found
    return None


@pytest.mark.parametrize(("error", "codes"), EVERY.items(), ids=lambda value: type(value).__name__)
def test_both_transports_say_the_same(error, codes):
    name, http = codes
    status, details = rich(error)
    problem = errors.to_problem(error)
    assert status.code.name == TWICE.get(name, name)
    assert detail(details, ErrorInfo).reason == name
    assert problem["status"] == http
    assert problem["type"] == f"urn:wayfarer:{name.lower()}"
    assert problem["detail"] == status.details == details.message
    assert errors.close_code(error) == 4000 + http


def test_every_error_of_the_tree_has_a_row():
    missing = set(raised.WayfarerError.__subclasses__()) - set(errors.TABLE)
    assert missing == {raised.ArtifactError, raised.DataError}  # the server's own faults


def test_fields_are_named_on_both():
    error = raised.InvalidArgument("too big", "goal.radius")
    bad = detail(rich(error)[1], BadRequest)
    assert [(v.field, v.description) for v in bad.field_violations] == [("goal.radius", "too big")]
    assert errors.to_problem(error)["errors"] == [{"field": "goal.radius", "detail": "too big"}]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("too big", "goal.radius: too big"),
        ("goal.radius holds 9; allowed: 0 to 5", "goal.radius holds 9; allowed: 0 to 5"),
        ("goal.radius2 is free", "goal.radius: goal.radius2 is free"),
        ("a.goal.radius is free", "goal.radius: a.goal.radius is free"),
    ],
)
def test_a_message_names_the_field_once(text, told):
    error = raised.InvalidArgument(text, "goal.radius")
    assert errors.to_problem(error)["detail"] == errors.to_grpc(error).details == told
    assert errors.close_reason(error) == errors.message_of(error) == told


def test_when_to_try_again_is_told_on_both():
    error = raised.ResourceExhausted("full", retry_after=2.5)
    assert detail(rich(error)[1], RetryInfo).retry_delay.ToMilliseconds() == 2500
    assert errors.to_problem(error)["retry_after_s"] == 2.5
    hopeless = raised.ResourceExhausted("full")
    assert detail(rich(hopeless)[1], RetryInfo) is None
    assert "retry_after_s" not in errors.to_problem(hopeless)


def test_headers_say_what_to_do():
    assert errors.headers_of(raised.ResourceExhausted("full", 2.5)) == {"retry-after": "3"}
    assert errors.headers_of(raised.ResourceExhausted("full")) == {}
    assert errors.headers_of(raised.Unavailable("starting")) == {"retry-after": "1"}
    who = errors.headers_of(raised.Unauthenticated("who?"))
    assert who == {"www-authenticate": 'Bearer realm="wayfarer"'}


def test_what_is_full_and_what_is_missing_are_told():
    full = detail(rich(raised.ResourceExhausted("full"))[1], QuotaFailure)
    assert full.violations[0].description == "full"
    missing = detail(rich(raised.NotFound("no agent 'x'", "agent", "x"))[1], ResourceInfo)
    assert (missing.resource_type, missing.resource_name) == ("agent", "x")


def test_the_documented_table_is_the_table():
    rows = [
        [cell.strip(" `") for cell in line.strip("|").split("|")]
        for line in DOCUMENT.read_text("utf-8").splitlines()
        if line.startswith("| `urn:")
    ]
    documented = {row[0]: (row[1], int(row[2]), int(row[3])) for row in rows}
    assert documented == {
        f"urn:wayfarer:{code.reason.lower()}": (code.grpc.name, code.http, 4000 + code.http)
        for code in (*errors.TABLE.values(), errors.INTERNAL)
    }


def test_where_the_call_should_have_gone_is_told_on_both():
    told = {"worker": 1, "grpc_port": 50053, "http_port": 8082, "host": "b.example"}
    error = raised.Misdirected("elsewhere", Endpoint(**told))
    assert schema.Problem(**errors.to_problem(error)).endpoint == schema.Endpoint(**told)
    metadata = detail(rich(error)[1], ErrorInfo).metadata
    assert dict(metadata) == {key: str(value) for key, value in told.items()}


def test_internals_are_not_told():
    for error in (raised.ArtifactError("secret path"), ZeroDivisionError("secret")):
        assert "secret" not in errors.to_grpc(error).details + str(errors.to_problem(error))


def test_the_nearest_place_that_can_be_reached_is_told():
    error = raised.Unreachable("no way", (1.0, -2.5, 3.0))
    _, details = rich(error)
    assert detail(details, ErrorInfo).metadata == {"x": "1.0", "y": "-2.5", "z": "3.0"}
    assert errors.to_problem(error)["nearest"] == {"x": 1.0, "y": -2.5, "z": 3.0}
    assert "nearest" not in errors.to_problem(raised.FailedPrecondition("not now"))
