"""Schema → runtime for goal commands: values in a session's basis → messages in world space."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pydantic import BaseModel

from wayfarer.errors import InvalidArgument
from wayfarer.transport import convert, schema
from wayfarer.transport.basis import Axes, Basis
from wayfarer.world import behaviours as runtime
from wayfarer.world.agents.agent import Goal
from wayfarer.world.goals.commands import Append, GoalCommand, Path, Stop

LENGTHS = ("speed", "behind", "right", "distance", "spacing")
"""Fields that are lengths, or lengths per second."""


Wish = schema.Goal | schema.Goals | schema.Wander | schema.Behaviour | None


def goal_command(wish: Wish, basis: Basis, append: bool = False) -> GoalCommand:
    """The command in world space; None: stop. Absent fields take the runtime's defaults.

    `append`: goals are added to the end of the path instead of replacing it.
    """
    match wish:
        case None:
            return Stop()
        case schema.Goal():
            return convert.goal(wish, basis)
        case schema.Goals():
            return (Append if append else Path)(_goals(wish.goals, basis))
        case schema.Wander():
            return wander(wish, basis)
        case schema.Behaviour():
            return _behaviour(wish, basis)


def _behaviour(wish: schema.Behaviour, basis: Basis) -> runtime.Behaviour:
    _, does = wish.given
    if isinstance(does, schema.Routine):
        parts = tuple(runtime.Part(_does(p.given[1], basis), p.seconds) for p in does.parts)
        return runtime.Routine(parts, does.repeat)
    return _does(does, basis)


def wander(wish: schema.Wander, basis: Basis) -> runtime.Wander:
    """In world space; what is absent takes the runtime's default."""
    given = _given(wish, basis.axes, exclude={"area"})
    if wish.area is None:
        return runtime.Wander(None, **given)
    radius = basis.axes.length_to_core(wish.area.radius)
    return runtime.Wander(_spot(wish.area.center, basis.axes), radius, **given)


@contextmanager
def fields_named(wish: Wish) -> Iterator[None]:
    """Name the field at fault as the client wrote it, with the kind of each behaviour."""
    try:
        yield
    except InvalidArgument as error:
        field = _client_field(error.field, wish)
        text = str(error).replace(error.field, field) if error.field else str(error)
        raise InvalidArgument(text, field) from None


def _client_field(field: str, wish: Wish) -> str:
    """`behaviour.parts[1].radius` → `behaviour.routine.parts[1].wander.area.radius`."""
    match wish:
        case schema.Wander():
            field = field.replace("behaviour.", "wander.", 1)
        case schema.Behaviour():
            kind, does = wish.given
            field = re.sub(r"^behaviour(?=\b)", f"behaviour.{kind}", field)
            found = re.match(r"behaviour\.routine\.parts\[(\d+)\](?!\.seconds)", field)
            if found is not None and isinstance(does, schema.Routine):
                part = does.parts[int(found[1])].given[0]
                field = f"{found[0]}.{part}{field[found.end() :]}"
    field = re.sub(r"\bwander\.(?=center|radius)", "wander.area.", field)
    return field.removeprefix("wander.")


def _does(wish: schema.Message, basis: Basis) -> runtime.PartBehaviour:
    axes = basis.axes
    match wish:
        case schema.Wander():
            return wander(wish, basis)
        case schema.Patrol():
            return runtime.Patrol(_goals(wish.goals, basis), wish.to_and_fro)
        case schema.Follow():
            return runtime.Follow(**_given(wish, axes))
        case schema.KeepAway():
            place = None if wish.place is None else _spot(wish.place, axes)
            return runtime.KeepAway(place=place, **_given(wish, axes, exclude={"place"}))
        case schema.Queue():
            given = _given(wish, axes, exclude={"head", "heading"})
            heading = axes.heading_to_core(wish.heading)
            return runtime.Queue(head=_spot(wish.head, axes), heading=heading, **given)
        case schema.Visit():
            return runtime.Visit(_goals(wish.goals, basis))
    return runtime.Stand()


def _goals(wishes: tuple[schema.Goal, ...], basis: Basis) -> tuple[Goal, ...]:
    return tuple(convert.goal(wish, basis) for wish in wishes)


def _given(wish: BaseModel, axes: Axes, exclude: set[str] | None = None) -> dict[str, Any]:
    """What is given, lengths in metres."""
    given = wish.model_dump(exclude_none=True, exclude=exclude)
    lengths = {name: axes.length_to_core(given[name]) for name in LENGTHS if name in given}
    return {**given, **lengths}


def _spot(point: schema.Vector3, axes: Axes) -> tuple[float, float]:
    x, y, _ = convert.place(point, axes)
    return x, y
