"""HTTP offers all that the protos do, and says so."""

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from google.protobuf import descriptor as protobuf
from openapi_spec_validator import validate
from starlette.routing import WebSocketRoute

from tests.transport.fakes import gateway
from wayfarer.transport.grpc_server.server import FILES
from wayfarer.transport.http_server import http_app

GUIDE = (Path(__file__).parents[2] / "docs" / "api.md").read_text("utf-8")
DOCUMENT = http_app(gateway()).openapi()
OPERATIONS = {
    operation["operationId"]: (path, method, operation)
    for path, item in DOCUMENT["paths"].items()
    for method, operation in item.items()
}
RPCS = {
    method.name: method
    for file in FILES
    for service in file.DESCRIPTOR.services_by_name.values()
    for method in service.methods
}
SOCKETS = {"StreamMotion": "/v1/stream", "Control": "/v1/control"}
ONLY_HTTP = {"streamEvents", "getBody", "getStats", "getLive", "getReady", "getStartup"}
WHOLE_BODY = {
    ("ImportSession", "snapshot"),
    ("Replay", "log"),
    ("SetGoal", "goal"),  # its fields are the body
    ("Replay", "format"),  # its fields are in the query
    ("PutObstacle", "obstacle"),
    ("Behave", "behaviour"),
    ("CreateMeshScene", "header"),  # likewise
    ("CreateMeshScene", "data"),
}


def operation_of(rpc: str) -> dict[str, Any]:
    return OPERATIONS[rpc[0].lower() + rpc[1:]][2]


def resolved(schema: dict[str, Any]) -> dict[str, Any]:
    while "$ref" in schema:
        schema = DOCUMENT["components"]["schemas"][schema["$ref"].rsplit("/", 1)[1]]
    for choice in schema.get("anyOf", ()):
        if "$ref" in choice:
            return resolved(choice)
    return schema


def fields_of(operation: dict[str, Any]) -> set[str]:
    """All that can be said in a request."""
    names = {parameter["name"] for parameter in operation.get("parameters", ())}
    for content in operation.get("requestBody", {}).get("content", {}).values():
        names |= set(resolved(content["schema"]).get("properties", ()))
    return names


def test_the_document_is_valid():
    validate(DOCUMENT)
    refs = {part.split('"')[0] for part in json.dumps(DOCUMENT).split('"$ref": "')[1:]}
    assert all(
        ref.removeprefix("#/components/schemas/") in DOCUMENT["components"]["schemas"]
        for ref in refs
    )


def test_every_rpc_has_its_route_and_no_other_route_is_unknown():
    names = {name[0].lower() + name[1:] for name in RPCS if name not in SOCKETS}
    assert set(OPERATIONS) == names | ONLY_HTTP
    paths = {route.path for route in sockets()}
    assert paths == set(SOCKETS.values())


def sockets() -> list[Any]:
    return [route for route in http_app(gateway()).routes if isinstance(route, WebSocketRoute)]


@pytest.mark.parametrize("rpc", sorted(set(RPCS) - set(SOCKETS)))
def test_every_field_of_a_request_can_be_said(rpc):
    said = fields_of(operation_of(rpc))
    fields = {field.name for field in RPCS[rpc].input_type.fields}
    assert {name for name in fields if (rpc, name) not in WHOLE_BODY} <= said


@pytest.mark.parametrize("rpc", sorted(set(RPCS) - set(SOCKETS)))
def test_every_field_of_an_answer_is_told(rpc):
    answers = operation_of(rpc)["responses"]
    (good,) = (answers[status] for status in answers if status.startswith("2"))
    fields = RPCS[rpc].output_type.fields
    if not fields:
        return
    (content,) = good["content"].values()
    schema = resolved(content["schema"])
    if schema.get("format") == "binary":
        assert [field.type for field in fields] == [protobuf.FieldDescriptor.TYPE_BYTES]
        return
    if len(fields) == 1 and fields[0].name not in schema["properties"]:
        fields = fields[0].message_type.fields  # the object itself, without a wrapper
    assert {field.name for field in fields} <= set(schema["properties"])


@pytest.mark.parametrize("name", OPERATIONS)
def test_every_operation_says_what_it_does_and_how_it_fails(name):
    path, _, operation = OPERATIONS[name]
    assert operation["summary"] and operation["tags"]
    if path.startswith("/v1/health"):
        return
    assert {"401", "403", "404", "409", "413", "422", "429", "500", "503"} <= set(
        operation["responses"]
    )
    for status, answer in operation["responses"].items():
        if int(status) >= 400:
            assert list(answer["content"]) == ["application/problem+json"], status
    for parameter in operation.get("parameters", ()):
        assert parameter.get("description") or parameter["name"] in ("body", "gender"), name


@pytest.mark.parametrize("name", DOCUMENT["components"]["schemas"])
def test_examples_are_valid(name):
    schema = DOCUMENT["components"]["schemas"][name]
    for example in schema.get("examples", ()):
        jsonschema.validate(
            example,
            {**schema, "components": DOCUMENT["components"]},
            jsonschema.Draft202012Validator,
        )


def test_bodies_that_change_something_have_examples():
    for name, (_, method, operation) in OPERATIONS.items():
        for content in operation.get("requestBody", {}).get("content", {}).values():
            schema = resolved(content["schema"])
            if "properties" in schema and name != "useModel":
                assert schema.get("examples"), (name, method)


def test_the_guide_lists_every_call():
    table = GUIDE.split("## All calls")[1].split("\n## ")[0]
    assert set(RPCS) <= set(re.findall(r"\b[A-Z][A-Za-z]+\b", table))
    listed = set(re.findall(r"/v1/[^ `?,]*", table))
    named = {re.sub(r"\{\w+_id\}", "{id}", path) for path in DOCUMENT["paths"]}
    shown = {path for path in named if not path.startswith("/v1/health")} | set(SOCKETS.values())
    assert shown <= listed
