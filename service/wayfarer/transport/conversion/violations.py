"""Pydantic's findings in a request, as sentences that state the allowed and the given value."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, get_args

from pydantic import BaseModel, ValidationError

from wayfarer.errors import InvalidArgument, unknown_name
from wayfarer.transport.errors import MAX_VIOLATIONS, InvalidRequest
from wayfarer.transport.schema import LINE

VALUE_LENGTH: Final = 40
"""Maximum characters of a value that an error repeats."""

NAME_LENGTH: Final = 64
"""Maximum characters of a field's name that an error repeats."""

_NUMBER: Final = "must be a number, not {value}"
_WHOLE: Final = "must be a whole number, not {value}"
_OBJECT: Final = "must be an object, not {value}"
_CHOICE: Final = "must be {expected}, not {value}"

TEXTS: Final[Mapping[str, str]] = {
    "bool_parsing": "must be true or false, not {value}",
    "bool_type": "must be true or false, not {value}",
    "enum": _CHOICE,
    "finite_number": "must be a finite number",
    "float_parsing": _NUMBER,
    "float_type": _NUMBER,
    "greater_than": "must be above {gt}, not {value}",
    "greater_than_equal": "must be at least {ge}, not {value}",
    "int_from_float": _WHOLE,
    "int_parsing": _WHOLE,
    "int_type": _WHOLE,
    "less_than": "must be below {lt}, not {value}",
    "less_than_equal": "must be at most {le}, not {value}",
    "literal_error": _CHOICE,
    "missing": "is needed",
    "model_attributes_type": _OBJECT,
    "model_type": _OBJECT,
    "string_too_long": "has {length} characters; allowed: at most {max_length}",
    "string_too_short": "has {length} characters; allowed: at least {min_length}",
    "string_type": "must be a text, not {value}",
    "too_long": "has {actual_length} items; allowed: at most {max_length}",
    "too_short": "has {actual_length} items; allowed: at least {min_length}",
    "tuple_type": "must be a list, not {value}",
    "value_error": "{error}",
}
"""Sentences by pydantic's error type; placeholders: its context, `value` and its `length`."""


def invalid_request(error: ValidationError, field: str = "", kind: Any = None) -> InvalidRequest:
    """The error for pydantic's findings in the part `field` of a request, of class `kind`."""
    return refusal(error.errors(include_url=False), (field,), kind)


def refusal(
    found: Sequence[Mapping[str, Any]], within: tuple[str, ...] = (), kind: Any = None
) -> InvalidRequest:
    """The error for a list of pydantic's findings; their places are relative to `within`, a `kind`.

    Pydantic also reports a list with wrong items as too short; that finding is omitted.
    """
    around = {e["loc"][:depth] for e in found for depth in range(len(e["loc"]))}
    causes = [e for e in found if e["loc"] not in around]
    violations = [
        (field_path((*within, *e["loc"])), sentence(e, kind)) for e in causes[:MAX_VIOLATIONS]
    ]
    return InvalidRequest(violations, len(causes) - len(violations))


def sentence(error: Mapping[str, Any], kind: Any = None) -> str:
    """The sentence for one finding in a `kind`."""
    value, context = error["input"], error.get("ctx", {})
    if error["type"] == "extra_forbidden":
        *parents, name = error["loc"]
        return unknown_name(str(name)[:NAME_LENGTH], _fields(kind, parents))
    if error["type"] == "string_pattern_mismatch" and context["pattern"] == LINE:
        return "must be one line without control characters"
    words = {k: _written(v) if isinstance(v, int | float) else v for k, v in context.items()}
    length = len(value) if isinstance(value, str) else 0
    text = TEXTS.get(error["type"], "{message}")
    return text.format(**words, message=error["msg"], value=_written(value), length=length)


def field_path(parts: Iterable[int | str]) -> str:
    """("agents", 0, "betas") → "agents[0].betas"."""
    text = "".join(
        f"[{part}]" if isinstance(part, int) else f".{part[:NAME_LENGTH]}"
        for part in parts
        if part != ""
    )
    return text.removeprefix(".")


def _written(value: object) -> str:
    """A value as JSON, shortened; lists and objects appear only as such."""
    if isinstance(value, list | tuple):
        return "a list"
    if not isinstance(value, str | int | float | None):
        return "an object"
    if isinstance(value, str) and len(value) > VALUE_LENGTH:
        return json.dumps(value[:VALUE_LENGTH]) + "…"
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        value = int(value)
    text = json.dumps(value)
    return text if isinstance(value, str) or len(text) <= VALUE_LENGTH else "a huge number"


def _fields(kind: Any, where: Iterable[int | str]) -> list[str]:
    """Names of the fields that the part `where` of a `kind` has."""
    model = next(_models(kind), None)
    for part in where:
        if model is not None and isinstance(part, str):
            model = next(_models(model.model_fields[part].annotation), None)
    return list(model.model_fields) if model is not None else []


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Models in `Model | None`, `tuple[Model, ...]` and the like."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from _models(inner)


def renamed(error: InvalidArgument, field: str) -> InvalidArgument:
    """The same error for a field with another name, also in the text."""
    text = str(error).replace(error.field, field) if error.field and field else str(error)
    return InvalidArgument(text, field)
