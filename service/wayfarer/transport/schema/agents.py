"""Agents."""

from enum import StrEnum
from typing import Annotated

from pydantic import ConfigDict, Field, field_validator, model_validator

from wayfarer.body.outfit import OUTFIT_TEXT
from wayfarer.body.phenotype import LIMITS
from wayfarer.spec import BETAS, JOINTS
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
from wayfarer.transport.schema.goals import Goal
from wayfarer.world.agents.agent import AgentState

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


class NewAgents(Message):
    """Agents to create, all or none."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"agents": [{"gender": "male", "phenotype": {"height_m": 1.85}, "name": "Ada"}]}
            ]
        }
    )

    agents: Many[AgentSpec] = Field(
        min_length=1, max_length=1024, description="at most limits.agents_per_call"
    )
    request_id: Text = Field(default="", description="see NewSession.request_id")


class AgentUpdate(Message):
    """A change of an agent; absent fields stay as they are."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"name": "Grace"}]})

    name: Text | None = Field(default=None, description="new name for display")
    foot_lock: Bool | None = Field(
        default=None, description="keep feet from sliding, from the next chunk on"
    )


class Agent(Message):
    """A snapshot of one agent."""

    agent_id: str
    alias: int = Field(description="replaces agent_id in the chunks of this session")
    session_id: str
    name: str
    body: str = Field(description="name of its body model")
    gender: Gender
    betas: tuple[float, ...]
    seed: int
    state: AgentState
    position: Vector3 = Field(description="position of the hips in the last frame sent")
    heading: float
    goal: Goal | None = None
    goal_revision: int = Field(description="number of goal commands so far; 0 before the first")
    created_at_us: int
    rest_offsets: tuple[float, ...] = Field(
        description=f"{JOINTS} × 3 numbers: each joint relative to its parent's in the T-pose"
    )
    waypoint: int = Field(default=0, description="index of `goal` in its path, from 0")
    waypoints: int = Field(default=0, description="number of goals of its path so far")
    foot_lock: bool = Field(default=True, description="feet are kept from sliding on the floor")
    model: str = Field(default="", description="the motion model that moves it; see /v1/models")
    outfit: str = Field(default="", description="what it wears: `outfit` of getBody")


class Agents(Message):
    """Agents in order of creation."""

    agents: tuple[Agent, ...]
