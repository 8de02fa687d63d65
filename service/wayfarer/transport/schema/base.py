"""Parts of the other messages, and types of fields that the protos cannot state."""

import json
from collections.abc import Mapping
from enum import Enum, StrEnum, auto
from typing import Annotated, Any, Final, Self, TypeVar, get_type_hints

from pydantic import (
    AfterValidator,
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

from wayfarer.body.phenotype import LIMITS
from wayfarer.body.skeleton import joint_names, load_skeleton
from wayfarer.clips.edit import FASTEST
from wayfarer.navigation import checks
from wayfarer.navigation.scene_spec import MAX_EXTENT, MIN_SIZE
from wayfarer.spec import BETAS, POSED_JOINTS, TURN
from wayfarer.transport.codec.pose_format import RATES
from wayfarer.transport.conversion.basis import Basis
from wayfarer.world import behaviours
from wayfarer.world.agents import goal
from wayfarer.world.agents.goal import DWELL, SPEED
from wayfarer.world.scenes.populate import MAX_RATE, MAX_STAY

Item = TypeVar("Item")

ID_LENGTH: Final = 64
"""Maximum characters of a session's or agent's id."""

MIN_MESSAGE_BYTES: Final = 16_384
"""Minimum size of a message: room for a header, and for an agent's chunk with its description."""

MIN_RADIUS: Final = 0.1
MAX_RADIUS: Final = 20_000.0
"""Metres of a ring."""

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
    """Exactly one of its fields that are null by default is given."""

    @classmethod
    def choices(cls) -> list[str]:
        """Names of the fields of which one is given."""
        return [name for name, field in cls.model_fields.items() if field.default is None]

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
            {"required": [name], "properties": {name: {"type": "object"}}} for name in cls.choices()
        ]
        return made

    @property
    def given(self) -> tuple[str, Message]:
        """The given field, and its name."""
        names = self.choices()
        return next((name, value) for name, value in self if value is not None and name in names)

    @model_validator(mode="after")
    def _one(self) -> Self:
        names = self.choices()
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


def _in_radians(heading: float) -> float:
    if abs(heading) > TURN:
        raise ValueError(f"must be in radians, from {-TURN} to {TURN}, not {heading:g}")
    return heading


Heading = Annotated[
    Float,
    AfterValidator(_in_radians),
    Field(json_schema_extra={"minimum": -TURN, "maximum": TURN}),
    Quantity.HEADING,
]


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


RANGES: Final[Mapping[str, Mapping[str, tuple[float | None, float | None]]]] = {
    "Cylinder": {"radius": (MIN_SIZE / 2, MAX_EXTENT), "height": (MIN_SIZE, MAX_EXTENT)},
    "CharacterJoints": {"floor": (None, None)},
    "InterestRing": {"radius": (MIN_RADIUS, MAX_RADIUS)},
    "Mesh": {"unit": checks.UNIT},
    "MotionFile": {"fps": (1, FASTEST)},
    "Phenotype": LIMITS,
    "Crowd": {
        **dict.fromkeys(("min_speed", "max_speed"), SPEED),
        **dict.fromkeys(("min_dwell", "max_dwell"), DWELL),
        "spawn_rate": (0, MAX_RATE),
        "stay": (0, MAX_STAY),
    },
    "Prism": {"height": (MIN_SIZE, MAX_EXTENT)},
    "Walkable": checks.WALKABLE,
}
"""Ranges of other messages' fields; lengths in metres."""


def range_of(message: str, field: str) -> Any:
    """Where a field's value has to lie, as the rules that check it state it."""
    if message in RANGES:
        return RANGES[message][field]
    return get_type_hints(DOMAIN[message], include_extras=True)[field].__metadata__[0]


def length_range(message: str, field: str) -> Any:
    """Range of a length or speed. The runtime checks it, since its form depends on the basis."""
    return Field(json_schema_extra=bounds(*range_of(message, field)))


def plain_range(message: str, field: str) -> Any:
    """Range of a number that means the same in every basis; it is checked by the schema."""
    low, high = range_of(message, field)
    return Field(ge=low, le=high)


def count_range(message: str, field: str) -> Any:
    """Range of a number of items."""
    low, high = range_of(message, field)
    return Field(min_length=low, max_length=high)


def example(text: str) -> ConfigDict:
    """Configuration of a message with an example in JSON."""
    return ConfigDict(json_schema_extra={"examples": [json.loads(text)]})


class Vector3(Message):
    """A point, at most 10 km from the origin along each axis, or a direction; in the basis of the
    session.
    """

    x: Float
    y: Float
    z: Float


Spot = Annotated[Vector3, Quantity.SPOT]
Extent = Annotated[Float, Field(ge=0, json_schema_extra=bounds(MIN_SIZE, MAX_EXTENT))]


class Extents(Message):
    """Lengths along the axes of the basis, before a heading turns them."""

    x: Extent
    y: Extent
    z: Extent


class Gender(StrEnum):
    """Gender of an agent's body."""

    FEMALE = "female"
    MALE = "male"


class MeshFormat(StrEnum):
    """File formats of meshes."""

    GLB = "glb"
    OBJ = "obj"
    PLY = "ply"


def _all_betas(betas: tuple[float, ...]) -> tuple[float, ...]:
    if betas and len(betas) != BETAS:
        raise ValueError(f"must be {BETAS} numbers or none, not {len(betas)}")
    return betas


Betas = Annotated[
    Many[Annotated[Float, Field(ge=-5, le=5)]],
    Field(max_length=BETAS, json_schema_extra={"anyOf": [{"maxItems": 0}, {"minItems": BETAS}]}),
    AfterValidator(_all_betas),
]


class OneBody(Message):
    """A body comes from numbers or from everyday terms."""

    @model_validator(mode="after")
    def _one_body(self) -> Self:
        given = dict(self)
        if given["betas"] and given["phenotype"] is not None:
            raise ValueError("give betas or phenotype, not both")
        return self


PosedBone = Annotated[str, Field(json_schema_extra={"enum": [*joint_names()[:POSED_JOINTS]]})]
BONES: Final = tuple(bone.name for bone in load_skeleton())
BoneName = Annotated[str, Field(json_schema_extra={"enum": [*BONES]})]
Bones = Annotated[
    Many[BoneName], Field(max_length=len(BONES), json_schema_extra={"uniqueItems": True})
]
Rate = Annotated[Uint32, Field(json_schema_extra={"enum": [0, *sorted(RATES)]})]
ModelName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
