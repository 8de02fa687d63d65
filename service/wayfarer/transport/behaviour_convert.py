"""Schema → runtime for behaviours: values in a session's basis → messages in world space."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pydantic import BaseModel

from wayfarer.errors import InvalidArgument
from wayfarer.runtime import agent as agents
from wayfarer.runtime import behaviours as runtime
from wayfarer.transport import convert, schema
from wayfarer.transport.basis import Axes, Basis

LENGTHS = ("speed", "behind", "right", "distance", "spacing")
"""Fields that are lengths, or lengths per second."""


def behaviour(wish: schema.Behaviour, basis: Basis) -> runtime.Behaviour | runtime.Routine:
    """In world space; what is absent takes the runtime's default."""
    _, does = wish.given
    if isinstance(does, schema.Routine):
        parts = tuple(runtime.Part(_does(p.given[1], basis), p.seconds) for p in does.parts)
        return runtime.Routine(parts, does.repeat)
    made = _does(does, basis)
    assert not isinstance(made, runtime.Visit | runtime.Stand)
    return made


def wander(wish: schema.Wander, basis: Basis) -> agents.Wander:
    """In world space; what is absent takes the runtime's default."""
    given = _given(wish, basis.axes, exclude={"area"})
    if wish.area is None:
        return agents.Wander(None, **given)
    radius = basis.axes.length_to_core(wish.area.radius)
    return agents.Wander(_spot(wish.area.center, basis.axes), radius, **given)


@contextmanager
def fields_named(wish: schema.Behaviour) -> Iterator[None]:
    """Name fields as the client has them, with the kind of each behaviour."""
    try:
        yield
    except InvalidArgument as error:
        field = _client_field(error.field, wish)
        text = str(error).replace(error.field, field) if error.field else str(error)
        raise InvalidArgument(text, field) from None


def _client_field(field: str, wish: schema.Behaviour) -> str:
    """`behaviour.parts[1].goals` → `behaviour.routine.parts[1].visit.goals`."""
    kind, does = wish.given
    field = re.sub(r"^behaviour(?=\b)", f"behaviour.{kind}", field)
    found = re.match(r"behaviour\.routine\.parts\[(\d+)\](?!\.seconds)", field)
    if found is None or not isinstance(does, schema.Routine):
        return field
    return f"{found[0]}.{does.parts[int(found[1])].given[0]}{field[found.end() :]}"


def _does(wish: schema.Message, basis: Basis) -> runtime.Visit | runtime.Stand | runtime.Behaviour:
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


def _goals(wishes: tuple[schema.Goal, ...], basis: Basis) -> tuple[agents.Goal, ...]:
    return tuple(convert.goal(wish, basis) for wish in wishes)


def _given(wish: BaseModel, axes: Axes, exclude: set[str] | None = None) -> dict[str, Any]:
    """What is given, lengths in metres."""
    given = wish.model_dump(exclude_none=True, exclude=exclude)
    lengths = {name: axes.length_to_core(given[name]) for name in LENGTHS if name in given}
    return {**given, **lengths}


def _spot(point: schema.Vector3, axes: Axes) -> tuple[float, float]:
    x, y, _ = convert.place(point, axes)
    return x, y
