"""Checks of records from outside, which name the field at fault and what is allowed."""

import math
from operator import attrgetter
from typing import Final

import numpy as np

from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument
from wayfarer.spec import MAX_COORDINATE
from wayfarer.world.agents.checks import check_agent_id, check_session_id, check_spec
from wayfarer.world.agents.goal import check_goal
from wayfarer.world.agents.records import AgentRecord, SessionRecord
from wayfarer.world.agents.slots import Mode
from wayfarer.world.behaviours import Routine, Stand
from wayfarer.world.rows import Rows, flat_columns

MAX_COUNT: Final = 2**31
"""Limit of sequence numbers, revisions, aliases and waypoints: 13 years of chunks."""

MAX_MODEL: Final = 256
"""Maximum characters of a model's name and stamp."""


def check_session_record(record: SessionRecord, limits: Limits) -> None:
    """Checks a record from outside. Raises InvalidArgument that names the fault."""
    check_session_id(record.session_id)
    _check_count(record.last_alias, "last_alias")
    _check_finite(record.created_at, "created_at")
    for number, agent in enumerate(record.agents):
        check_agent_record(agent, limits, f"agents[{number}]")
        if agent.alias > record.last_alias:
            raise InvalidArgument(
                f"alias is {agent.alias}; allowed: at most last_alias, {record.last_alias}",
                f"agents[{number}].alias",
            )
    for name in ("agent_id", "alias"):
        if len({getattr(agent, name) for agent in record.agents}) < len(record.agents):
            raise InvalidArgument(f"two agents have the same {name}", "agents")


def check_agent_record(record: AgentRecord, limits: Limits, where: str) -> None:
    """`where` names the record in messages. Raises InvalidArgument."""
    check_agent_id(record.agent_id, f"{where}.agent_id")
    check_spec(record.spec, f"{where}.spec")
    _check_finite(record.created_at, f"{where}.created_at")
    for name in ("alias", "seq", "goal_revision", "passed"):
        _check_count(getattr(record, name), f"{where}.{name}")
    if len(record.model) > MAX_MODEL:
        raise InvalidArgument(
            f"has {len(record.model)} characters; allowed: {MAX_MODEL}", f"{where}.model"
        )
    _check_path(record, limits, where)
    _check_rows(record.motion, f"{where}.motion")
    _check_rows(record.footing, f"{where}.footing")
    _check_behaviour(record, limits, f"{where}.behaviour")
    gait, seed = record.motion.gait, record.motion.seed
    if not (0 <= gait.mode[0] < len(Mode)):
        raise InvalidArgument("holds an unknown mode", f"{where}.motion.gait.mode")
    place = int(gait.waypoint[0]) - record.passed
    if not 0 <= place < max(len(record.path), 1):
        raise InvalidArgument(
            f"waypoint is {int(gait.waypoint[0])}; allowed: {record.passed} to "
            f"{record.passed + max(len(record.path), 1) - 1}, those of the path",
            f"{where}.motion.gait.waypoint",
        )
    if (np.abs(np.linalg.norm(seed.rotations, axis=-1) - 1) > 1e-2).any():
        raise InvalidArgument("rotations must be unit quaternions", f"{where}.motion.seed")


def _check_path(record: AgentRecord, limits: Limits, where: str) -> None:
    # A path may have been extended for long, so its parts are checked but not their distance.
    for number, goal in enumerate(record.path):
        check_goal(goal, goal.position, limits, f"{where}.path[{number}]")
    for value in record.path_start:
        _check_finite(value, f"{where}.path_start")


def _check_behaviour(record: AgentRecord, limits: Limits, where: str) -> None:
    behaviour = record.behaviour
    if behaviour is None or isinstance(behaviour, Stand):
        return
    behaviour.check(None, limits, where)
    _check_count(record.begun, f"{where}.begun")
    if not 0 <= record.part <= (len(behaviour.parts) if isinstance(behaviour, Routine) else 0):
        raise InvalidArgument(f"part is {record.part}; there is none", f"{where}.part")


def _check_rows(rows: Rows, where: str) -> None:
    """Checks that there is one row, with only numbers that motion can have."""
    for column in flat_columns(type(rows)):
        values = attrgetter(column.path)(rows)
        if values.shape != (1, *column.shape):
            raise InvalidArgument(f"{column.path} has the shape {values.shape}", where)
        if column.dtype.kind == "f" and not (np.abs(values) <= 2 * MAX_COORDINATE).all():
            raise InvalidArgument(
                f"{column.path} holds numbers beyond {2 * MAX_COORDINATE:g} or none at all", where
            )


def _check_count(value: int, where: str) -> None:
    if not 0 <= value < MAX_COUNT:
        raise InvalidArgument(f"is {value}; allowed: 0 to {MAX_COUNT - 1}", where)


def _check_finite(value: float, where: str) -> None:
    if not math.isfinite(value):
        raise InvalidArgument(f"is {value}; allowed: finite numbers", where)
