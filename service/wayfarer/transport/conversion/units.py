"""Conversion of message fields between a client's basis and world space, by their units.

A schema class defines the unit of each field (`schema.Quantity`); points are `schema.Vector3`.
Fields without a unit mean the same in every basis.
"""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Final, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from wayfarer.transport.conversion.basis import Axes
from wayfarer.transport.schema import base as schema
from wayfarer.transport.schema.base import Quantity

Made = TypeVar("Made")

TO_CORE: Final = {Quantity.LENGTH: Axes.length_to_core, Quantity.HEADING: Axes.heading_to_core}
TO_WIRE: Final = {Quantity.LENGTH: Axes.length_to_wire, Quantity.HEADING: Axes.heading_to_wire}


def in_world(kind: Callable[..., Made], request: BaseModel, axes: Axes, **others: Any) -> Made:
    """A `kind` with the fields that are given, in world space: metres, headings about +Z, points as
    x, y, z.

    Nested messages, and lists of them, are not converted: `others` replaces them.
    """
    units = _units(type(request))
    given = {name: _in_world(v, units.get(name), axes) for name, v in request if v is not None}
    return kind(**given | others)


def on_wire(kind: type[BaseModel], found: object, axes: Axes) -> dict[str, Any]:
    """The fields of `kind`, taken from `found` in world space, in the basis."""
    units = _units(kind)
    values = {name: getattr(found, name) for name in kind.model_fields}
    return {name: _on_wire(v, units.get(name), axes) for name, v in values.items()}


def place(point: schema.Vector3, axes: Axes) -> tuple[float, float, float]:
    """A point of the world in metres."""
    x, y, z = (float(v) for v in axes.points_to_core(np.array([point.x, point.y, point.z])))
    return x, y, z


def spot(point: schema.Vector3, axes: Axes) -> tuple[float, float]:
    """A point on the floor in metres."""
    x, y, _ = place(point, axes)
    return x, y


def vector(values: NDArray[np.floating[Any]]) -> schema.Vector3:
    """Three numbers as a message."""
    x, y, z = (float(value) + 0.0 for value in values)  # + 0.0: no negative zero
    return schema.Vector3(x=x, y=y, z=z)


def _in_world(value: Any, unit: Quantity | None, axes: Axes) -> Any:
    if isinstance(value, schema.Vector3):
        return spot(value, axes) if unit is Quantity.SPOT else place(value, axes)
    return value if unit is None else TO_CORE[unit](axes, value)


def _on_wire(value: Any, unit: Quantity | Any, axes: Axes) -> Any:
    if unit is schema.Vector3:
        return vector(axes.points_to_wire(np.array(value, dtype=float)))
    return value if unit is None or value is None else TO_WIRE[unit](axes, value)


@cache
def _units(kind: type[BaseModel]) -> Mapping[str, Any]:
    """The unit of each field that has one; `Vector3` for points."""
    found: dict[str, Any] = {}
    for name, field in kind.model_fields.items():
        inner = [mark for part in get_args(field.annotation) for mark in _marks(part)]
        units = [mark for mark in (*field.metadata, *inner) if isinstance(mark, Quantity)]
        if units:
            found[name] = units[0]
        elif field.annotation is schema.Vector3:
            found[name] = schema.Vector3
    return found


def _marks(annotation: Any) -> tuple[Any, ...]:
    return getattr(annotation, "__metadata__", ())
