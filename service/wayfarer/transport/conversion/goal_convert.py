"""Schema → runtime for goal commands: values in a session's basis → messages in world space."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from wayfarer.errors import InvalidArgument
from wayfarer.transport import schema
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.conversion.units import in_world
from wayfarer.world import behaviours
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.commands import Append, GoalCommand, Path, Stop

CommandRequest = schema.Goal | schema.Goals | schema.Wander | schema.Behaviour | None


def goal_command(request: CommandRequest, basis: Basis, append: bool = False) -> GoalCommand:
    """The command in world space; None: stop. Missing fields take the runtime's defaults.

    `append`: goals are added to the end of the path instead of replacing it.
    """
    match request:
        case None:
            return Stop()
        case schema.Goal():
            return goal(request, basis)
        case schema.Goals():
            return (Append if append else Path)(_goals(request.goals, basis))
    return _behaviour(request, basis)


def _behaviour(request: schema.Message, basis: Basis) -> Any:
    """A behaviour in world space, of its name's class; missing fields take its defaults."""
    axes = basis.axes
    given = in_world(request, axes)
    match request:
        case schema.Behaviour():
            return _behaviour(request.given[1], basis)
        case schema.Part():
            return behaviours.Part(_behaviour(request.given[1], basis), request.seconds)
        case schema.Routine():
            given["parts"] = tuple(_behaviour(part, basis) for part in request.parts)
        case schema.Wander():
            area = given.pop("area", None)
            given |= in_world(area, axes) if area else {"center": None}
        case schema.Patrol() | schema.Visit():
            given["goals"] = _goals(request.goals, basis)
    return behaviours.KINDS[type(request).__name__](**given)


def goal(request: schema.Goal, basis: Basis) -> Goal:
    """The goal in world space. Missing fields take the runtime's defaults."""
    return Goal(**in_world(request, basis.axes))


def _goals(goals: tuple[schema.Goal, ...], basis: Basis) -> tuple[Goal, ...]:
    return tuple(goal(each, basis) for each in goals)


@contextmanager
def fields_named(request: CommandRequest) -> Iterator[None]:
    """Names the field at fault as the client wrote it, with the kind of each behaviour."""
    try:
        yield
    except InvalidArgument as error:
        raise renamed(error, _client_field(error.field, request)) from None


def renamed(error: InvalidArgument, field: str) -> InvalidArgument:
    """The same error for a field with another name, also in the text."""
    text = str(error).replace(error.field, field) if error.field and field else str(error)
    return InvalidArgument(text, field)


def _client_field(field: str, request: CommandRequest) -> str:
    """`behaviour.parts[1].radius` → `behaviour.routine.parts[1].wander.area.radius`."""
    match request:
        case schema.Wander():
            field = field.replace("behaviour.", "wander.", 1)
        case schema.Behaviour():
            kind, does = request.given
            field = re.sub(r"^behaviour(?=\b)", f"behaviour.{kind}", field)
            found = re.match(r"behaviour\.routine\.parts\[(\d+)\](?!\.seconds)", field)
            if found is not None and isinstance(does, schema.Routine):
                part = does.parts[int(found[1])].given[0]
                field = f"{found[0]}.{part}{field[found.end() :]}"
    field = re.sub(r"\bwander\.(?=center|radius)", "wander.area.", field)
    return field.removeprefix("wander.")
