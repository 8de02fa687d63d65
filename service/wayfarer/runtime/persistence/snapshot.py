"""A session at rest as bytes, and back: what ExportSession gives and ImportSession takes.

A container (container.py) with a JSON header, which pydantic validates, and one row of raw arrays
per agent. JSON, because names, goals and attributes are few and must be checked by type; raw
arrays, because motion must come back bit for bit, and because their length follows from the number
of agents alone, which `np.savez` would take from the (untrusted) file.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Annotated, ClassVar, Final, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from wayfarer.config.limits import Limits
from wayfarer.errors import FailedPrecondition, InvalidArgument, WayfarerError
from wayfarer.runtime.persistence.container import ContainerKind, beginning, unseal
from wayfarer.runtime.persistence.packing import pack, row_bytes, unpack
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentSpec, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.records import AgentRecord, SessionRecord
from wayfarer.world.agents.slots import Gait, Motion, Seeds
from wayfarer.world.avoidance.people import Aims, Memory
from wayfarer.world.behaviours import AnyBehaviour
from wayfarer.world.output.ground import Footing
from wayfarer.world.record_checks import check_session_record
from wayfarer.world.rows import Flags, Float, Index, Int, Rows, Shape

M = TypeVar("M", bound=BaseModel)
H = TypeVar("H", bound="SnapshotHeader")

GOAL_BYTES: Final = 320
"""More than the JSON of a goal takes."""

AGENT_BYTES: Final = 8192
"""More than the JSON of an agent takes, its path aside."""

SESSION_BYTES: Final = 1 << 18
"""More than the JSON of a session takes, its agents aside."""

REACH: Final = 3.0
"""Metres: no marker or sole of a body is farther from its hips."""

NAMED_WITHIN: Final = 4096
"""The session's id stands within this many bytes from the start of the header."""

_SESSION_ID: Final = re.compile(rb'"session_id":"([\w-]{1,64})"')

MAX_ATTRIBUTES: Final = 64
MAX_ATTRIBUTE: Final = 2048  # characters


@dataclass(frozen=True, slots=True)
class BodyStamp:
    """Which body motion belongs to."""

    name: str
    sha256: Mapping[str, str]  # of the body's file, by gender

    def __str__(self) -> str:
        prints = ", ".join(f"{gender} {sha[:12]}" for gender, sha in sorted(self.sha256.items()))
        return f"body {self.name!r} ({prints})"


@dataclass(slots=True)
class RetiredColumns(Rows):
    """Places of what the foot lock used to remember: rows keep their layout. All but `progress` are
    zeros.
    """

    soles: Annotated[Float, Shape(2, 4, 3)]
    contact: Annotated[Flags, Shape(2)]
    progress: Annotated[Float, Shape(2)]  # `Aims.stuck` and `Aims.advanced`
    shift: Annotated[Float, Shape(2, 3)]
    begun: Flags


@dataclass(slots=True)
class EarlierAims(Rows):
    """The columns of `Aims` that rows have had from the start."""

    wants: Flags
    asked: Annotated[Float, Shape(2)]
    spot: Annotated[Float, Shape(2)]
    barred: Float


@dataclass(slots=True)
class AgentRows(Rows):
    """Agents at rest: the arrays of `AgentRecord`."""

    seq: Int
    seed: Seeds
    gait: Gait
    retired: RetiredColumns
    footing: Footing
    memory: Memory
    aims: EarlierAims

    @classmethod
    def of(cls, seq: Index, motion: Motion, footing: Footing) -> "AgentRows":
        """Joins its parts."""
        retired, aims = RetiredColumns.empty(len(seq)), motion.aims
        retired.progress[:, 0], retired.progress[:, 1] = aims.stuck, aims.advanced
        earlier = EarlierAims(aims.wants, aims.asked, aims.spot, aims.barred)
        return cls(seq, motion.seed, motion.gait, retired, footing, motion.memory, earlier)

    @property
    def motion(self) -> Motion:
        """How the agents move."""
        aims, (stuck, advanced) = self.aims, np.ascontiguousarray(self.retired.progress.T)
        joined = Aims(aims.wants, aims.asked, aims.spot, aims.barred, stuck, advanced)
        return Motion(self.seed, self.gait, self.memory, joined)


@dataclass(frozen=True, slots=True)
class AgentPart:
    """`AgentRecord` without its arrays."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    agent_id: str
    alias: int
    spec: AgentSpec
    created_at: float
    goal_revision: int
    path: tuple[Goal, ...]
    passed: int
    path_start: tuple[float, float]
    behaviour: AnyBehaviour | None = None
    part: int = 0
    begun: int = 0
    model: str = ""


@dataclass(frozen=True, slots=True)
class SessionPart:
    """`SessionRecord` without its agents."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    session_id: str
    spec: SessionSpec
    created_at: float
    last_alias: int


class SnapshotHeader(BaseModel):
    """The JSON of a snapshot."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    fps: int
    body: BodyStamp
    session: SessionPart
    agents: tuple[AgentPart, ...]


def decode_session(data: bytes, body: BodyStamp, limits: Limits) -> SessionRecord:
    """The record of a snapshot that anybody may have made.

    Raises InvalidArgument that names what is wrong, FailedPrecondition when it is sound but was
    made for another body, frame rate or format.
    """
    header, arrays = open_snapshot(
        SnapshotHeader, data, body, most_bytes(limits), most_values(limits)
    )
    return join_session(header.session, join_agents(header.agents, arrays, limits), limits)


def open_snapshot(
    kind: type[H], data: bytes, body: BodyStamp, most: int, values: int
) -> tuple[H, bytes]:
    """Header and arrays of up to `most` bytes, the header of up to `values` values. Raises as
    `decode_session`.
    """
    text, arrays = unseal(ContainerKind.SNAPSHOT, data, most)
    header = parse(kind, text, ContainerKind.SNAPSHOT, values)
    check_origin(header.fps, header.body, body, ContainerKind.SNAPSHOT)
    return header, arrays


def named_session(data: bytes) -> str:
    """Id of the session in a snapshot; empty where it says none.

    The bytes are untrusted; only `decode_session` checks them.
    """
    try:
        found = _SESSION_ID.search(beginning(ContainerKind.SNAPSHOT, data, NAMED_WITHIN))
    except WayfarerError:
        return ""
    return found[1].decode() if found else ""


# The parts of a record


def agent_part(record: AgentRecord) -> AgentPart:
    """The part of an agent in the header."""
    return AgentPart(**{part.name: getattr(record, part.name) for part in fields(AgentPart)})


def pack_agent(record: AgentRecord) -> bytes:
    """The arrays of an agent: one row."""
    return pack(AgentRows.of(np.array([record.seq]), record.motion, record.footing)).tobytes()


def join_session(
    part: SessionPart, agents: tuple[AgentRecord, ...], limits: Limits
) -> SessionRecord:
    """A session's record, if all of it could be one of ours. Raises InvalidArgument."""
    record = SessionRecord(
        part.session_id, part.spec, part.created_at, part.last_alias, agents=agents
    )
    _check_attributes(part.spec)
    check_session_record(record, limits)
    for number, agent in enumerate(agents):
        check_body(agent, f"agents[{number}]")
    return record


def join_agent(part: AgentPart, row: AgentRows) -> AgentRecord:
    """An agent's record; `row` is one."""
    return AgentRecord(
        **{field.name: getattr(part, field.name) for field in fields(AgentPart)},
        seq=int(row.seq[0]),
        motion=row.motion,
        footing=row.footing,
    )


def join_agents(
    parts: Sequence[AgentPart], arrays: bytes, limits: Limits
) -> tuple[AgentRecord, ...]:
    """The records of all agents. Raises InvalidArgument."""
    if len(parts) > limits.agents_per_session:
        raise InvalidArgument(
            f"there are {len(parts)} agents; allowed: {limits.agents_per_session}", "agents"
        )
    rows = unpack(AgentRows, arrays, "agents")
    if len(rows.seq) != len(parts):
        raise InvalidArgument(
            f"there are {len(parts)} agents and the motion of {len(rows.seq)}", "agents"
        )
    return tuple(
        join_agent(part, rows.take(np.array([number]))) for number, part in enumerate(parts)
    )


# Checks


def most_bytes(limits: Limits) -> int:
    """Upper bound of a snapshot that this server accepts, before compression."""
    agent = AGENT_BYTES + row_bytes(AgentRows) + 2 * GOAL_BYTES * (limits.path_goals + 8)
    return SESSION_BYTES + limits.agents_per_session * agent


def most_values(limits: Limits) -> int:
    """Upper bound of the values in its header."""
    return 1000 + limits.agents_per_session * (64 + 16 * 2 * (limits.path_goals + 8))


def parse(model: type[M], text: bytes, kind: ContainerKind, values: int) -> M:
    """A header of up to `values` values. Raises InvalidArgument that names the field at fault."""
    if text.count(b",") > values:  # parsed values take up to a hundred times their bytes
        raise InvalidArgument(f"{kind.field} has more than {values} values", kind.field)
    try:
        return model.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join([kind.field, *(str(part) for part in first["loc"])])
        raise InvalidArgument(f"{where}: {first['msg']}", where) from None


def check_origin(fps: int, made_for: BodyStamp, body: BodyStamp, kind: ContainerKind) -> None:
    """Raises FailedPrecondition when this server cannot continue motion of that body."""
    if fps != FPS:
        raise FailedPrecondition(f"{kind.field} has {fps} frames per second; this server has {FPS}")
    if made_for != body:
        raise FailedPrecondition(f"{kind.field} was made with {made_for}; this server has {body}")


def _check_attributes(spec: SessionSpec) -> None:
    if len(spec.attributes) > MAX_ATTRIBUTES or any(
        len(text) > MAX_ATTRIBUTE for pair in spec.attributes.items() for text in pair
    ):
        raise InvalidArgument(
            f"a session has at most {MAX_ATTRIBUTES} attributes of {MAX_ATTRIBUTE} characters",
            "session.spec.attributes",
        )


def check_body(record: AgentRecord, where: str) -> None:
    """Checks that a body on the floor can move like this. Raises InvalidArgument."""
    seed = record.motion.seed
    hips = seed.translation[0]
    spans = {
        "motion.seed.markers": seed.markers[0] - hips[:, None],
        "motion.seed.translation": hips[:, 2],
        "motion.gait.stop_facing": record.motion.gait.stop_facing,
    }
    for name, values in spans.items():
        if not (np.abs(values) <= REACH).all():
            raise InvalidArgument(
                f"{name} is not that of a body on the floor: it is farther than {REACH:g} m off",
                f"{where}.{name}",
            )
