"""Agents to create: a body comes from numbers or from everyday terms."""

from enum import StrEnum
from typing import Annotated

from pydantic import Field, field_validator, model_validator

from wayfarer.body.outfit import OUTFIT_TEXT
from wayfarer.body.phenotype import LIMITS
from wayfarer.spec import BETAS
from wayfarer.transport.schema.base import (
    Bool,
    Float,
    Heading,
    Many,
    Message,
    Text,
    Uint32,
    Vector3,
)

Beta = Annotated[Float, Field(ge=-5, le=5)]


class Gender(StrEnum):
    """Gender of an agent's body."""

    FEMALE = "female"
    MALE = "male"


class Phenotype(Message):
    """A body in everyday terms; an absent field takes the mean."""

    height_m: Float | None = Field(
        default=None,
        ge=LIMITS["height_m"][0],
        le=LIMITS["height_m"][1],
        description="standing height barefoot, in metres in every basis",
    )
    weight: Float | None = Field(
        default=None,
        ge=LIMITS["weight"][0],
        le=LIMITS["weight"][1],
        description="from thin (0) to heavy (1); average 0.5",
    )
    muscle: Float | None = Field(
        default=None,
        ge=LIMITS["muscle"][0],
        le=LIMITS["muscle"][1],
        description="from slack (0) to athletic (1); average 0.5",
    )
    age: Float | None = Field(
        default=None, ge=LIMITS["age"][0], le=LIMITS["age"][1], description="age in years"
    )


class AgentSpec(Message):
    """An agent to create. The body comes from `betas` or `phenotype`, not both."""

    gender: Gender = Gender.FEMALE
    betas: Many[Beta] = Field(
        default=(),
        max_length=BETAS,
        description=f"{BETAS} shape coefficients, or none for the mean body",
        json_schema_extra={"anyOf": [{"maxItems": 0}, {"minItems": BETAS}]},
    )
    phenotype: Phenotype | None = None
    position: Vector3 | None = Field(
        default=None,
        description="where it starts, on the ground below this point; the origin if absent",
    )
    heading: Heading = Field(
        default=0.0,
        description="direction it faces: radians about up, 0 faces the basis's forward",
    )
    seed: Uint32 | None = Field(
        default=None,
        description="determines the motion; drawn from the session's seed if absent",
    )
    name: Text = Field(default="", description="name for display; need not be unique")
    foot_lock: Bool = Field(
        default=True,
        description="keep feet from sliding on the floor; false: the model's own poses",
    )
    model: Text = Field(
        default="",
        description="loaded motion model that moves it, see /v1/models; else that in use",
    )
    outfit: Text = Field(default="", description=f"what it wears: {OUTFIT_TEXT}")

    @field_validator("betas")
    @classmethod
    def _all_betas(cls, betas: tuple[float, ...]) -> tuple[float, ...]:
        if betas and len(betas) != BETAS:
            raise ValueError(f"must be {BETAS} numbers or none, not {len(betas)}")
        return betas

    @model_validator(mode="after")
    def _one_body(self) -> "AgentSpec":
        if self.betas and self.phenotype is not None:
            raise ValueError("give betas or phenotype, not both")
        return self
