"""Parts of the other messages."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from enum import Enum, auto
from typing import Annotated, Any, ClassVar, Final, Self, TypeVar, get_type_hints

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    FailFast,
    Field,
    GetJsonSchemaHandler,
    Strict,
    model_validator,
)
from pydantic.config import JsonDict
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from wayfarer import endpoint as endpoints
from wayfarer.transport.conversion.basis import Basis
from wayfarer.world import behaviours
from wayfarer.world.agents import goal
from wayfarer.world.agents.goal import DWELL, MAX_HEADING, SPEED

Item = TypeVar("Item")

UINT32: Final = (1 << 32) - 1


def _whole(value: object) -> object:
    """JSON does not distinguish 7.0 from 7, and some writers do not either."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


Float = Annotated[float, Strict()]
"""A JSON number; "1" and true are refused."""

Uint32 = Annotated[int, Strict(), Field(ge=0, le=UINT32), BeforeValidator(_whole)]
"""A JSON number without a fraction; 7.0 is one.

Bounds precede the validator: after it, pydantic would write `ge` instead of `minimum`.
"""

Bool = Annotated[bool, Strict()]

LINE: Final = r"^[^\x00-\x1f\x7f]*$"
"""Pattern of a text without control characters."""

Text = Annotated[str, Field(max_length=64, pattern=LINE)]
"""A short line: no control characters."""

Many = Annotated[tuple[Item, ...], FailFast()]
"""A list in a request. Validation stops at the first wrong item, since errors for all items of a
long list would take seconds.
"""


class Message(BaseModel):
    """Base of all: frozen, finite numbers only, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class OneOf(Message):
    """Exactly one of its fields is given and not null, apart from fields in `COMMON_FIELDS`."""

    COMMON_FIELDS: ClassVar[frozenset[str]] = frozenset()

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """In a request exactly one is given, and it is not null."""
        made = handler(core_schema)
        if handler.mode == "serialization":
            return made
        schema = handler.resolve_ref_schema(made)
        schema["oneOf"] = [
            {"required": [name], "properties": {name: {"type": "object"}}}
            for name in schema["properties"]
            if name not in cls.COMMON_FIELDS
        ]
        return made

    @property
    def given(self) -> tuple[str, Message]:
        """The given field, and its name."""
        return next(
            (name, value)
            for name, value in self
            if value is not None and name not in self.COMMON_FIELDS
        )

    @model_validator(mode="after")
    def _one(self) -> Self:
        names = [name for name in type(self).model_fields if name not in self.COMMON_FIELDS]
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            found = f"{' and '.join(given)} are" if given else "none is"
            raise ValueError(f"give exactly one of {', '.join(names)}; {found} given")
        return self


UNITS: Final = tuple({basis.axes.metres_per_unit for basis in Basis})


class Quantity(Enum):
    """The kinds of values whose form depends on the basis. See units.py."""

    LENGTH = auto()  # a length, or a length per second
    HEADING = auto()  # radians about up
    SPOT = auto()  # a point on the floor; its component along up is ignored


Length = Annotated[Float, Quantity.LENGTH]
Heading = Annotated[Float, Field(ge=-MAX_HEADING, le=MAX_HEADING), Quantity.HEADING]
Dwell = Annotated[Float, Field(ge=DWELL[0], le=DWELL[1])]


def bounds(low: float | None, high: float | None) -> JsonDict:
    """Bounds of a length or speed for JSON schema; `low` and `high` are in metres.

    They are the widest of all bases, since a schema has only one; the runtime checks the request
    with the bounds of its own basis.
    """
    found: JsonDict = {}
    if low is not None:
        found["minimum"] = min(low / unit for unit in UNITS)
    if high is not None:
        found["maximum"] = max(high / unit for unit in UNITS)
    return found


DOMAIN: Final[Mapping[str, Any]] = {
    **behaviours.KINDS,
    "Area": behaviours.Wander,
    "Goal": goal.Goal,
    "Part": behaviours.Part,
}
"""Classes of world/ by their twin messages; they define the ranges of the fields."""


def _range(message: str, field: str) -> Any:
    return get_type_hints(DOMAIN[message], include_extras=True)[field].__metadata__[0]


def length_range(message: str, field: str) -> Any:
    """Range of a length or speed. The runtime checks it, since its form depends on the basis."""
    return Field(json_schema_extra=bounds(*_range(message, field)))


def plain_range(message: str, field: str) -> Any:
    """Range of a number that means the same in every basis; it is checked by the schema."""
    low, high = _range(message, field)
    return Field(ge=low, le=high)


def count_range(message: str, field: str) -> Any:
    """Range of a number of items."""
    low, high = _range(message, field)
    return Field(min_length=low, max_length=high)


def example(text: str) -> ConfigDict:
    """Configuration of a message with an example in JSON."""
    return ConfigDict(json_schema_extra={"examples": [json.loads(text)]})


def length_field(
    what: str,
    allowed: tuple[float, float],
    default: float | None = None,
    unit: str = "m",
    **more: Any,
) -> Any:
    """A `Length`, described with its bounds and its default, both in metres.

    A field with a default may be missing; the default is the domain class's own.
    """
    text = f"{what}; " if what else ""
    text += f"{allowed[0]:g} to {allowed[1]:g} {unit}"
    if default is not None:
        text += f"; default {default:g} {unit}"
        more["default"] = None
    return Field(description=text, json_schema_extra=bounds(*allowed), **more)


def speed_field(what: str, default: float) -> Any:
    """An optional speed; see `length_field`."""
    return length_field(what, SPEED, default, "m/s")


class Vector3(Message):
    """A point, at most 10 km from the origin along each axis, or a direction; in the basis of the
    session.
    """

    x: Float
    y: Float
    z: Float


Spot = Annotated[Vector3, Quantity.SPOT]


class BasisInfo(Message):
    """What a basis means."""

    basis: Basis
    metres_per_unit: float = Field(description="length of one unit: 1 or 0.01")
    right_handed: bool
    up: Vector3 = Field(description="unit vector that points up")
    forward: Vector3 = Field(description="unit vector that a body faces at heading 0")
    quaternion_order: str = "xyzw"


class Endpoint(Message):
    """One process, with its own ports, of a service that has several."""

    worker: int = Field(description="its number, from 0")
    grpc_port: int
    http_port: int = Field(description="of HTTP and WebSocket")
    host: str = Field(
        default="", description="empty: the host at which the service was called; as TLS knows it"
    )

    @classmethod
    def of(cls, endpoint: endpoints.Endpoint) -> Self:
        """Converts its twin."""
        return cls(**asdict(endpoint))


class FieldProblem(Message):
    """One field at fault."""

    field: str = Field(description='path of the field, as in "goals[3].speed"')
    detail: str


class Problem(Message):
    """RFC 9457 problem document; docs/errors.md lists the types."""

    type: str
    title: str
    status: int
    detail: str = Field(description="what was wrong, where, and what is allowed")
    errors: tuple[FieldProblem, ...] = Field(default=(), description="all fields at fault")
    retry_after_s: float | None = Field(default=None, description="when to try again")
    endpoint: Endpoint | None = Field(
        default=None, description="of type misdirected: where the session or agent lives"
    )
    nearest: Vector3 | None = Field(
        default=None, description="of type unreachable: the nearest place that can be reached"
    )
