"""Comments of the protos, docs/api.md and the Python client state the range and default of a field
that is checked.

Classes of the schema are generated from the protos, and their descriptions are the comments. What
checks lengths, speeds and times is compared with them.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, fields
from inspect import getsource
from pathlib import Path
from typing import Any, get_type_hints

import pytest
from pydantic import BaseModel

import wayfarer_client
from wayfarer.transport import schema
from wayfarer.transport.conversion.violations import _models
from wayfarer.transport.schema.base import DOMAIN, RANGES, UINT32, range_of

ROOT = Path(__file__).parents[2]

REQUESTS = (
    *(schema.NewSession, schema.NewAgents, schema.Goal, schema.Goals, schema.Wander),
    *(schema.Behaviour, schema.NewScene, schema.Mesh, schema.Obstacle, schema.PathQuery),
    *(schema.Crowd, schema.StreamRequest, schema.ClipRequest, schema.StepRequest),
    *(schema.MotionExport, schema.CharacterJoints),
)
"""Messages whose fields, and those of the messages in them, are compared."""

OTHER_NAMES = {"CreateSessionRequest": "NewSession"}
"""Names of classes whose messages have another."""

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


def pairs() -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Message, field and JSON schema of every field of the requests, each once."""
    waiting, met = list[type[BaseModel]](REQUESTS), set[type[BaseModel]]()
    while waiting:
        kind = waiting.pop()
        if kind in met:
            continue
        met.add(kind)
        for name, field in kind.model_json_schema()["properties"].items():
            if name not in IDS and "description" in field:
                yield kind.__name__, name, field
        waiting += [m for f in kind.model_fields.values() for m in _models(f.annotation)]


def held(field: dict[str, Any], message: str = "", name: str = "") -> Said:
    """The checks of a request's field. Bounds of lengths come from world/ or from the description,
    since those of JSON schema are the widest of all bases.
    """
    world = DOMAIN.get(message)
    hint = get_type_hints(world, include_extras=True).get(name) if world else None
    if name in RANGES.get(message, ()) or hasattr(hint, "__metadata__"):
        bounds = tuple(bound for bound in range_of(message, name) if bound is not None)
        return Said(bounds, world and next(f.default for f in fields(world) if f.name == name))
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


def whole(text: str) -> str:
    """A comment, with the comments that it refers to."""
    for other, name in re.findall(r"(?:[Aa]s|[Ss]ee) (\w+)\.(\w+)", text):
        model = getattr(schema, OTHER_NAMES.get(other, other), None)
        if model is not None and name in model.model_fields:
            text += f" {model.model_fields[name].description}"
    return text


def test_a_comment_is_read():
    assert said("radius: 0.05 m to 10 m; 0.3 m when absent").bounds == (0.05, 10)
    assert said("in [-100, 100]").bounds == (-100, 100)
    assert said("0.2 m/s (a stroll) to 4 m/s (a run); 1.2 m/s when absent.").bounds == (0.2, 4)
    assert said("at most 2,000 of them").bounds == (2000,)
    assert said("1.2 m/s when absent").default == said("default 1.2 m/s").default == 1.2
    assert held({"minimum": 0, "maximum": 60, "description": "default 40"}).bounds == (0, 60)


def test_the_protos_say_what_the_schema_holds():
    wrong, compared = [], 0
    for message, name, field in pairs():
        text, rule = whole(field["description"]), held(field, message, name)
        comment = said(field["description"])
        numbers = {_number(found) for found in re.findall(NUMBER, text)}
        if "Limits." in text or "ListBodies" in text:
            missing = set()  # the server's own, below the schema's
        else:
            missing = {b for b in rule.bounds if b > 1 or b < 0} - numbers
        false = set(comment.bounds) - set(rule.bounds) if rule.bounds else set()
        other = comment.default != rule.default and None not in (comment.default, rule.default)
        compared += bool(rule.bounds)
        if missing or false or other:
            wrong.append((f"{message}.{name}", missing, false, comment.default, rule.default))
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
