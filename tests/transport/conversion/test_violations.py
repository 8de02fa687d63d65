import json

import pytest
from pydantic import ValidationError

from wayfarer.transport import errors, schema
from wayfarer.transport.conversion.violations import invalid_request, refusal

POSITION = {"x": 0, "y": 0, "z": 0}
RADIANS = "must be in radians, from -6.2832 to 6.2832"


def refused(kind, values, field=""):
    with pytest.raises(ValidationError) as caught:
        kind.model_validate(values)
    return invalid_request(caught.value, field, kind)


def test_all_wrong_fields_are_named():
    values = {"heading": float("nan"), "betas": [9.0], "name": "x" * 65}
    error = refused(schema.AgentSpec, values, "agents[3]")
    assert [field for field, _ in error.violations] == [
        "agents[3].betas[0]",
        "agents[3].heading",
        "agents[3].name",
    ]
    assert "nan" not in str(errors.to_problem(error)).lower()  # JSON has none


@pytest.mark.parametrize(
    ("kind", "values", "told"),
    [
        (schema.AgentSpec, {"betas": [100]}, "betas[0]: must be at most 5, not 100"),
        (schema.AgentSpec, {"betas": [-5.5]}, "betas[0]: must be at least -5, not -5.5"),
        (schema.AgentSpec, {"betas": [1, 2]}, "betas: must be 10 numbers or none, not 2"),
        (schema.AgentSpec, {"betas": [1] * 11}, "betas: has 11 items; allowed: at most 10"),
        (schema.AgentSpec, {"gender": "x"}, "gender: must be 'female' or 'male', not \"x\""),
        (schema.AgentSpec, {"seed": 1.5}, "seed: must be a whole number, not 1.5"),
        (schema.AgentSpec, {"heading": "1"}, 'heading: must be a number, not "1"'),
        (schema.AgentSpec, {"heading": None}, "heading: must be a number, not null"),
        (schema.AgentSpec, {"heading": [1]}, "heading: must be a number, not a list"),
        (schema.AgentSpec, {"heading": 90}, f"heading: {RADIANS}, not 90"),
        (
            schema.Goals,
            {"goals": [{"position": POSITION, "heading": -180}]},
            f"goals[0].heading: {RADIANS}, not -180",
        ),
        (
            schema.Queue,
            {"name": "till", "head": POSITION, "heading": 45},
            f"heading: {RADIANS}, not 45",
        ),
        (schema.AgentSpec, {"foot_lock": 1}, "foot_lock: must be true or false, not 1"),
        (schema.AgentSpec, {"position": 3}, "position: must be an object, not 3"),
        (schema.AgentSpec, {"name": 3}, "name: must be a text, not 3"),
        (schema.AgentSpec, {"name": "a\nb"}, "name: must be one line without control characters"),
        (schema.AgentSpec, {"name": "x" * 65}, "name: has 65 characters; allowed: at most 64"),
        (schema.AgentSpec, {"gendr": "male"}, "gendr: unknown; did you mean gender?"),
        (schema.Goals, {"goals": []}, "goals: has 0 items; allowed: at least 1"),
        (schema.Goals, {"goals": {}}, "goals: must be a list, not an object"),
        (schema.Goals, {}, "goals: is needed"),
        (
            schema.Goals,
            {"goals": [{"position": {**POSITION, "colour": 1}}]},
            "goals[0].position.colour: unknown; known are x, y, z",
        ),
        (
            schema.Obstacle,
            {},
            "give exactly one of box, cylinder, prism; none is given",
        ),
    ],
)
def test_a_message_says_what_is_allowed_and_what_came(kind, values, told):
    assert str(refused(kind, values)) == told


@pytest.mark.parametrize("value", ["y" * 10**6, 10**300, {"a": ["b"] * 10**5}, "\ud800"])
def test_a_value_is_repeated_in_part(value):
    error = refused(schema.AgentSpec, {"gender": value})
    assert (len(str(error)) < 120 and str(error).isascii()) or str(error).endswith("…")
    json.dumps(errors.to_problem(error)).encode()


def test_many_unknown_names_cost_little():
    names = {f"{'k' * 10_000}{number}": 1 for number in range(1000)}
    error = refused(schema.AgentSpec, names)
    assert len(error.violations) == errors.MAX_VIOLATIONS
    assert str(error).endswith("; and 984 more") and len(str(error)) < 4000


def test_what_is_wrong_only_for_its_parts_is_left_out():
    places = ((), ("goals",), ("goals", 0, "speed"), ("goals2",))
    found = [{"loc": loc, "type": "missing", "msg": "", "input": None} for loc in places]
    told = [field for field, _ in refusal(found).violations]
    assert told == ["goals[0].speed", "goals2"]


def test_of_many_violations_the_first_are_told():
    one = {"type": "missing", "msg": "", "input": None}
    error = refusal([{**one, "loc": ("goals", i, "speed")} for i in range(100_000)])
    assert len(error.violations) == errors.MAX_VIOLATIONS and len(str(error)) < 1000
    assert str(error).endswith(f"; and {100_000 - errors.MAX_VIOLATIONS} more")
