"""Checks of callers' requests, which name the field at fault and what is allowed."""

import re
from collections.abc import Sequence
from typing import Final

from wayfarer.errors import Heading, InvalidArgument
from wayfarer.spec import BETAS, GENDERS, MAX_COORDINATE
from wayfarer.world.agents.agent import AgentChange, AgentSpec, SessionSpec
from wayfarer.world.ranges import check_place, check_range

MAX_BETA: Final = 5.0
MAX_NAME: Final = 64
ID: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


def check_session_id(session_id: str) -> None:
    """Raises InvalidArgument."""
    _check_id(session_id, "session_id", "session_id")


def check_session(spec: SessionSpec) -> None:
    """Raises InvalidArgument."""
    if spec.session_id is not None:
        check_session_id(spec.session_id)
    _check_seed(spec.seed, "seed")


def check_agent_id(agent_id: str, where: str) -> None:
    """Raises InvalidArgument."""
    _check_id(agent_id, "agent_id", where)


def check_spec(spec: AgentSpec, where: str) -> None:
    """`where` names the spec in messages, e.g. `agents[2]`. Raises InvalidArgument."""
    if spec.gender not in GENDERS:
        raise InvalidArgument(
            f"gender is {spec.gender!r}; allowed: {', '.join(GENDERS)}", f"{where}.gender"
        )
    if len(spec.betas) != BETAS:
        raise InvalidArgument(f"needs {BETAS} betas, got {len(spec.betas)}", f"{where}.betas")
    check_range(spec.betas, -MAX_BETA, MAX_BETA, f"{where}.betas")
    check_place(spec.position, f"{where}.position", spec.floor)
    check_range([spec.heading], -MAX_COORDINATE, MAX_COORDINATE, f"{where}.heading", Heading)
    _check_seed(spec.noise_seed, f"{where}.noise_seed")
    check_name(spec.name, f"{where}.name")


def check_specs(specs: Sequence[AgentSpec]) -> None:
    """Checks agents to be created together. Raises InvalidArgument."""
    for number, spec in enumerate(specs):
        check_spec(spec, f"agents[{number}]")


def check_change(change: AgentChange) -> None:
    """Raises InvalidArgument."""
    if change.name is not None:
        check_name(change.name, "name")


def _check_id(value: str, name: str, field: str) -> None:
    if not ID.fullmatch(value):
        raise InvalidArgument(
            f"{name} must be 1 to 64 of A-Z a-z 0-9 . _ -, beginning with a letter or digit", field
        )


def _check_seed(seed: int, field: str) -> None:
    if not 0 <= seed < 2**64:
        raise InvalidArgument(f"{field} must lie in [0, 2^64)", field)


def check_name(name: str, field: str, least: int = 0) -> None:
    """Raises InvalidArgument."""
    if not least <= len(name) <= MAX_NAME:
        raise InvalidArgument(
            f"name has {len(name)} characters; allowed: {least} to {MAX_NAME} characters", field
        )
