"""Messages in JSON that no proto has."""

from pydantic import ConfigDict, Field

from wayfarer.transport.schema.base import Message, OneOf, Vector3
from wayfarer.transport.schema.messages import Endpoint, MotionBatch, StreamHeader


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


class ClipLine(OneOf):
    """One line of a clip or replay: a header first, then batches; a problem if it broke off.

    It has one key.
    """

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})

    header: StreamHeader | None = None
    batch: MotionBatch | None = None
    problem: Problem | None = None


class Health(Message):
    """The answer to a probe."""

    status: str


class Stats(Message):
    """Health of the motion loop over the last few seconds."""

    agents: int
    sessions: int
    subscribers: int
    steps: int = Field(description="agent steps since start")
    step_ms_mean: float = Field(description="mean of one engine call")
    step_ms_p95: float
    late_chunks: int = Field(description="chunks that were late, since start")
    lateness_ms_p95: float
    uptime_s: float
    resets: int = Field(description="agents put back to a stand because they fell, since start")
    failures: int = Field(description="turns of the loop that raised, since start")
    skipped_steps: int = Field(
        description="agent steps never made because their time was over, since start"
    )
    skipped_by_sight: dict[str, int] = Field(
        description="those, by how well the reader that sees an agent best does: as in `sights`"
    )
    dropped_batches: int = Field(
        description="batches that open streams lost because they were too slow"
    )
    reduced_steps: int = Field(
        description="agent steps with fewer candidates because time was short, since start"
    )
    held_sessions: int = Field(description="sessions whose agents now wait for a slow reader")
    states: dict[str, int] = Field(description="agents in each state")
    sights: dict[str, int] = Field(
        description="agents by how well the reader that sees each best does: near (also in sessions"
        " with a stream without rings, or without any), far, root, none"
    )
    capacity: int = Field(description="agents that fit, by the measured cost; 0: not known yet")
    load: float = Field(
        description="share of the last seconds that the engine, or the loop, was busy"
    )
    degradation_level: int = Field(description="degradation level; 0: nothing is left out")
    held_steps: int = Field(description="steps not made for idle agents, since start")
    coasted_steps: int = Field(
        description="steps of agents seen as a root at most that were made without the model, "
        "because time was short, since start"
    )
    refused_agents: int = Field(description="agents refused because time was short, since start")
    mended_steps: int = Field(
        description="agent steps with a knee kept within its limits, since start"
    )
    journal_failing: bool = Field(
        description="true: changes cannot be written, and would not survive a restart"
    )
