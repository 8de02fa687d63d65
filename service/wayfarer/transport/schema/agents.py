"""Agents."""

from enum import StrEnum
from typing import Annotated

from pydantic import ConfigDict, Field, model_validator

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
    """Which of the shipped bodies an agent has."""

    FEMALE = "female"
    MALE = "male"


class Phenotype(Message):
    """A body in everyday words; absent fields take the mean."""

    height_m: Float | None = Field(
        default=None, ge=LIMITS["height_m"][0], le=LIMITS["height_m"][1], description="barefoot"
    )
    weight: Float | None = Field(
        default=None,
        ge=LIMITS["weight"][0],
        le=LIMITS["weight"][1],
        description="thin (0) to heavy (1)",
    )
    muscle: Float | None = Field(
        default=None,
        ge=LIMITS["muscle"][0],
        le=LIMITS["muscle"][1],
        description="slack (0) to athletic (1)",
    )
    age: Float | None = Field(
        default=None, ge=LIMITS["age"][0], le=LIMITS["age"][1], description="years"
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
        default=None, description="start, on the floor; the origin if absent"
    )
    heading: Heading = Field(
        default=0.0, description="radians about up; 0 faces the basis's forward"
    )
    seed: Uint32 | None = Field(
        default=None,
        description="the motion is reproducible from it; drawn from the session's seed if absent",
    )
    name: Text = Field(default="", description="to show; need not be unique")
    foot_lock: Bool = Field(
        default=True,
        description="keep feet on the floor from sliding; false: poses as the model makes them",
    )

    @model_validator(mode="after")
    def _one_body(self) -> "AgentSpec":
        if self.betas and self.phenotype is not None:
            raise ValueError("give betas or phenotype, not both")
        if self.betas and len(self.betas) != BETAS:
            raise ValueError(f"betas must be {BETAS} numbers or none, not {len(self.betas)}")
        return self


class NewAgents(Message):
    """Asks for agents, all or none."""

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
    """A change of an agent; absent fields stay."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"name": "Grace"}]})

    name: Text | None = Field(default=None, description="a new name to show")
    foot_lock: Bool | None = Field(default=None, description="from the next chunk on")


class Agent(Message):
    """A snapshot of one agent."""

    agent_id: str
    alias: int = Field(description="stands for agent_id in the chunks of this session")
    session_id: str
    name: str
    body: str = Field(description="name of its body model")
    gender: Gender
    betas: tuple[float, ...]
    seed: int
    state: AgentState
    position: Vector3 = Field(description="hips, last sent frame")
    heading: float
    goal: Goal | None = None
    goal_revision: int = Field(description="of the goal or path; 0 before the first")
    created_at_us: int
    rest_offsets: tuple[float, ...] = Field(
        description=f"{JOINTS} × 3 numbers: each joint relative to its parent's in the T-pose"
    )
    waypoint: int = Field(default=0, description="place of `goal` in its path, from 0")
    waypoints: int = Field(default=0, description="goals of its path")
    foot_lock: bool = Field(default=True, description="feet on the floor are kept from sliding")
    model: str = Field(default="", description="the motion model that moves it; see /v1/models")


class Agents(Message):
    """Agents in order of creation."""

    agents: tuple[Agent, ...]
