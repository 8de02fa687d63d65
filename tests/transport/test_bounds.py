"""Proto, OpenAPI, docs/api.md and the Python client state the same range and default of a field.

The schema checks requests; everything else is compared with it.
"""

import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, fields
from inspect import getsource
from pathlib import Path
from typing import Any, get_type_hints

import protoc
import pytest
from google.protobuf import descriptor_pb2
from pydantic import BaseModel, TypeAdapter

import wayfarer_client
from wayfarer.transport import schema
from wayfarer.transport.schema.base import DOMAIN, UINT32

ROOT = Path(__file__).parents[2]

REQUESTS = {
    "CreateSessionRequest": schema.NewSession,
    "CreateAgentsRequest": schema.NewAgents,
    "Goal": schema.Goal,
    "SetPathRequest": schema.Goals,
    "WanderRequest": schema.Wander,
    "Behaviour": schema.Behaviour,
    "CreateSceneRequest": schema.NewScene,
    "Mesh": schema.Mesh,
    "Obstacle": schema.Obstacle,
    "QueryPathRequest": schema.PathQuery,
    "PopulateSessionRequest": schema.Crowd,
    "StreamMotionRequest": schema.StreamRequest,
    "GenerateClipRequest": schema.ClipRequest,
    "StepAgentsRequest": schema.StepRequest,
    "ExportMotionRequest": schema.MotionExport,
    "FitBodyRequest": schema.CharacterJoints,
}
"""Messages whose fields, and those of the messages in them, are compared."""

IDS = {"session_id", "agent_id", "agent_ids", "scene"}
"""The server makes these, so a client need not know their maximum length."""

NUMBER = r"[-−]?\d[\d,]*(?:\.\d+)?"
RANGE = rf"({NUMBER})(?: m| m/s)?(?: \([^)]*\))? (?:to|…) ({NUMBER})|\[({NUMBER}), ({NUMBER})\]"
DEFAULT = rf"({NUMBER})(?: m| m/s)? when\s+absent|default ({NUMBER})( h)?|None: ({NUMBER})"


@dataclass(frozen=True, slots=True)
class Said:
    """The statements of a text about a field; lengths in metres."""

    bounds: tuple[float, ...]
    default: float | None
    text: str = ""


def said(text: str) -> Said:
    found = re.search(RANGE, text)
    bounds = [_number(part) for part in found.groups() if part] if found else []
    if not found and (most := re.search(rf"at most ({NUMBER})", text)):
        bounds = [_number(most[1])]
    given = re.search(DEFAULT, text)
    default = None
    if given:
        hours = 3600 if given[3] else 1
        default = hours * _number(next(part for part in (given[1], given[2], given[4]) if part))
    return Said(tuple(bounds), default, text)


def _number(text: str) -> float:
    return float(text.replace(",", "").replace("−", "-"))


@pytest.fixture(scope="module")
def comments(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], tuple[str, str]]:
    """By message and field: its comment, and the message that is its type, if any."""
    image = tmp_path_factory.mktemp("protos") / "image.binpb"
    sources = sorted((ROOT / "proto").rglob("*.proto"))
    options = ("--include_source_info", f"--descriptor_set_out={image}", f"-I{ROOT / 'proto'}")
    subprocess.run([str(protoc.PROTOC_EXE), *options, *map(str, sources)], check=True)
    found = {}
    for file in descriptor_pb2.FileDescriptorSet.FromString(image.read_bytes()).file:
        lines = {tuple(at.path): at.leading_comments for at in file.source_code_info.location}
        for i, message in enumerate(file.message_type):
            for j, field in enumerate(message.field):
                comment = " ".join(lines[4, i, 2, j].split())
                found[message.name, field.name] = comment, field.type_name.split(".")[-1]
    return found


def pairs(comments: dict[tuple[str, str], tuple[str, str]]) -> Iterator[tuple[str, str, Any]]:
    """Message, field and JSON schema of every field of the requests, each once."""
    met: set[str] = set()

    def of(message: str, model: dict[str, Any], named: dict[str, Any]) -> Iterator[Any]:
        for name, field in model.get("properties", {}).items():
            if message in met or (message, name) not in comments or name in IDS:
                continue
            yield message, name, field
            for inner in _refs(field):
                yield from of(comments[message, name][1], named[inner], named)
        met.add(message)

    for message, twin in REQUESTS.items():
        whole = (
            twin.model_json_schema()
            if isinstance(twin, type) and issubclass(twin, BaseModel)
            else TypeAdapter(twin).json_schema()
        )
        yield from of(message, whole, whole.get("$defs", {}))


def _refs(field: object) -> Iterator[str]:
    if isinstance(field, dict):
        if "$ref" in field:
            yield field["$ref"].rsplit("/", 1)[1]
        for value in field.values():
            yield from _refs(value)
    elif isinstance(field, list):
        for value in field:
            yield from _refs(value)


def held(field: dict[str, Any], message: str = "", name: str = "") -> Said:
    """The checks of a request's field. Bounds of lengths come from world/ or from the description,
    since those of JSON schema are the widest of all bases.
    """
    if world := DOMAIN.get(message.removesuffix("Request")):
        hint = get_type_hints(world, include_extras=True).get(name)
        if bounds := getattr(hint, "__metadata__", ((),))[0]:
            default = next(each.default for each in fields(world) if each.name == name)
            return Said(tuple(b for b in bounds if b is not None), default)
    described = said(field.get("description", ""))
    if described.bounds:
        return described
    kinds = [field, *field.get("anyOf", ()), *([field["items"]] if "items" in field else [])]
    found = {
        key: kind[key]
        for key in ("minimum", "maximum", "minItems", "maxItems", "minLength", "maxLength")
        for kind in kinds
        if key in kind and "enum" not in kind
    }
    bounds = tuple(float(v) for v in found.values() if v != UINT32)
    return Said(bounds, described.default, described.text)


def whole(comments: dict[tuple[str, str], tuple[str, str]], message: str, name: str) -> str:
    """A field's comment, with the comments that it refers to."""
    text = comments[message, name][0]
    for other in re.findall(r"(?:[Aa]s|[Ss]ee) (\w+)\.(\w+)", text):
        if other in comments and other != (message, name):
            text += " " + comments[other][0]
    return text


def test_a_comment_is_read():
    assert said("radius: 0.05 m to 10 m; 0.3 m when absent").bounds == (0.05, 10)
    assert said("in [-100, 100]").bounds == (-100, 100)
    assert said("0.2 m/s (a stroll) to 4 m/s (a run); 1.2 m/s when absent.").bounds == (0.2, 4)
    assert said("at most 2,000 of them").bounds == (2000,)
    assert said("1.2 m/s when absent").default == said("default 1.2 m/s").default == 1.2
    assert held({"minimum": 0, "maximum": 60, "description": "default 40"}).bounds == (0, 60)


def test_the_protos_say_what_the_schema_holds(comments):
    wrong, compared = [], 0
    for message, name, field in pairs(comments):
        text, rule = whole(comments, message, name), held(field, message, name)
        proto = said(comments[message, name][0])
        numbers = {_number(found) for found in re.findall(NUMBER, text)}
        if "Limits." in text or "ListBodies" in text:
            missing = set()  # the server's own, below the schema's
        else:
            missing = {b for b in rule.bounds if b > 1 or b < 0} - numbers
        false = set(proto.bounds) - set(rule.bounds) if proto.bounds and rule.bounds else set()
        other = proto.default != rule.default and None not in (proto.default, rule.default)
        compared += bool(rule.bounds)
        if missing or false or other:
            wrong.append((f"{message}.{name}", missing, false, proto.default, rule.default))
    assert not wrong, "\n".join(map(str, wrong))
    assert compared > 40


def test_the_table_of_goals_says_the_same():
    page = (ROOT / "docs" / "api.md").read_text("utf-8")
    table = page.split("| field of a goal |")[1].split("\n\n")[0]
    properties = schema.Goal.model_json_schema()["properties"]
    rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \|", table, re.MULTILINE)
    assert {name for name, _ in rows} == set(properties)
    for name, text in rows:
        rule = held(properties[name], "Goal", name)
        assert said(text).bounds == rule.bounds, name
        if rule.default is not None:
            assert _number(re.findall(NUMBER, text)[-1]) == rule.default, name


@pytest.mark.parametrize("name", ["Phenotype", "Wander", "Follow", "KeepAway", "Queue"])
def test_the_python_client_says_the_same(name: str):
    properties = getattr(schema, name).model_json_schema()["properties"]
    lines = re.findall(
        r"^    (\w+): [^#\n]*# (.*)$", getsource(getattr(wayfarer_client, name)), re.MULTILINE
    )
    assert lines
    for field, text in lines:
        if field in properties:
            rule, client = held(properties[field], name, field), said(text)
            assert client.bounds in ((), rule.bounds), f"{field}: {text}"
            assert client.default in (None, rule.default), f"{field}: {text}"
