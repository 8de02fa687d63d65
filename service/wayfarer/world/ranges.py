"""Checks of callers' numbers and places: errors name the field and what is allowed."""

from collections.abc import Callable, Iterable

from wayfarer.errors import InvalidArgument, Metres, Place
from wayfarer.spec import MAX_COORDINATE


def check_place(place: tuple[float, ...], field: str, height: float = 0.0) -> None:
    """Checks a place on the floor, or at a height. Raises InvalidArgument."""
    if len(place) != 2:
        raise InvalidArgument("must be x, y on the floor", field)
    point = (*place, height)
    if not all(-MAX_COORDINATE <= value <= MAX_COORDINATE for value in point):  # a NaN fails too
        raise InvalidArgument(
            "{} is {}; allowed: at most {} from the origin along each axis",
            field,
            field,
            Place(point),
            Metres(MAX_COORDINATE),
        )


def check_range(
    values: Iterable[float],
    low: float,
    high: float,
    field: str,
    kind: Callable[[float], object] = "{:g}".format,
) -> None:
    """Checks finite numbers within limits; `kind`: of quantity. Raises InvalidArgument."""
    for value in values:
        if not low <= value <= high:  # a NaN fails too
            raise InvalidArgument(
                "{} holds {}; allowed: {} to {}", field, field, kind(value), kind(low), kind(high)
            )
