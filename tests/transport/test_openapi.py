"""HTTP offers all that the protos do, and says so."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from google.protobuf import descriptor as protobuf
from openapi_spec_validator import validate
from pydantic import ValidationError
from starlette.routing import WebSocketRoute

from tests.transport.fakes import gateway
from wayfarer.transport import schema
from wayfarer.transport.contract import FILES
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
    ("CreateMeshScene", "header"),  # also in the query
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
    """All fields of a request."""
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


KEYWORDS = {
    *("$ref", "type", "enum", "const", "format", "title", "description", "default", "examples"),
    *("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"),
    *("minLength", "maxLength", "pattern"),
    *("minItems", "maxItems", "uniqueItems", "items", "prefixItems"),
    *("properties", "required", "additionalProperties", "minProperties", "maxProperties"),
    *("anyOf", "oneOf"),
}
"""Keywords of JSON schema 2020-12 that the document uses."""


def subschemas(schema: dict[str, Any]) -> Iterator[dict[str, Any]]:
    yield schema
    for name in ("items", "additionalProperties"):
        if isinstance(schema.get(name), dict):
            yield from subschemas(schema[name])
    for name in ("anyOf", "oneOf", "prefixItems"):
        for inner in schema.get(name, ()):
            yield from subschemas(inner)
    for inner in schema.get("properties", {}).values():
        yield from subschemas(inner)


def all_schemas() -> Iterator[dict[str, Any]]:
    for message in DOCUMENT["components"]["schemas"].values():
        yield from subschemas(message)
    for _, _, operation in OPERATIONS.values():
        for parameter in operation.get("parameters", ()):
            yield from subschemas(parameter["schema"])
        for answer in (operation.get("requestBody", {}), *operation["responses"].values()):
            for content in answer.get("content", {}).values():
                yield from subschemas(content.get("schema", {}))


def test_schemas_use_keywords_of_json_schema_only():
    """A keyword that no tool knows, such as `ge`, would hide a bound."""
    assert {keyword for schema in all_schemas() for keyword in schema} - KEYWORDS == set()


PLACE = {"x": 1, "y": 1, "z": 1}


def test_every_number_of_a_request_has_bounds_unless_they_depend_on_the_basis():
    free = {"Vector3.x", "Vector3.y", "Vector3.z", "Floor.height", "Prism.bottom"}
    free.add("CharacterJoints.floor")
    found = set()
    for name in request_schemas():
        for field, part in DOCUMENT["components"]["schemas"][name].get("properties", {}).items():
            inner = list(subschemas(part))
            is_number = any(one.get("type") in ("number", "integer") for one in inner)
            keys = {key for one in inner for key in one}
            if is_number and not (keys & {"maximum", "enum"} and keys & {"minimum", "enum"}):
                found.add(f"{name.removesuffix('-Input')}.{field}")
    assert found == free


def request_schemas() -> set[str]:
    """Names of all schemas that a request can hold."""
    found: set[str] = set()
    bodies = [
        content["schema"]
        for _, _, operation in OPERATIONS.values()
        for content in operation.get("requestBody", {}).get("content", {}).values()
    ]
    while bodies:
        for part in subschemas(bodies.pop()):
            name = part.get("$ref", "").rpartition("/")[2]
            if name and name not in found:
                found.add(name)
                bodies.append(DOCUMENT["components"]["schemas"][name])
    return found


@pytest.mark.parametrize(
    ("obstacle", "valid"),
    [
        ({"cylinder": {"position": PLACE, "radius": 1, "height": 1}}, True),
        ({"cylinder": {"position": PLACE, "radius": 1, "height": 1}, "prism": None}, True),
        ({"box": None, "prism": None}, False),
        ({"prism": None}, False),
        ({}, False),
        (
            {
                "cylinder": {"position": PLACE, "radius": 1, "height": 1},
                "box": {"position": PLACE, "size": PLACE},
            },
            False,
        ),
    ],
)
def test_of_several_kinds_one_is_given_and_the_others_may_be_null(obstacle, valid):
    """The document and the server agree."""
    schemas = DOCUMENT["components"]["schemas"]
    name = "Obstacle-Input" if "Obstacle-Input" in schemas else "Obstacle"
    document = {"$ref": f"#/components/schemas/{name}", "components": DOCUMENT["components"]}
    assert jsonschema.Draft202012Validator(document).is_valid(obstacle) == valid
    try:
        schema.Obstacle.model_validate(obstacle)
    except ValidationError:
        assert not valid
    else:
        assert valid


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
    schemas = [resolved(content["schema"]) for content in good["content"].values()]
    if any(schema.get("format") == "binary" for schema in schemas):  # a file, of several kinds
        assert protobuf.FieldDescriptor.TYPE_BYTES in [field.type for field in fields]
        fields = [f for f in fields if f.type != protobuf.FieldDescriptor.TYPE_BYTES]
        schemas = [schema for schema in schemas if schema.get("format") != "binary"]
    if not (fields or schemas):
        return
    (schema,) = schemas
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
