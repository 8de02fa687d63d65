"""Every error that Wayfarer raises on purpose.

    WayfarerError
    ├── InvalidArgument      a value is malformed or outside its range
    ├── NotFound             no such session, agent, body or model
    ├── AlreadyExists        the name is taken
        ├── FailedPrecondition   the request is valid, but not in the present state
    │   └── Unreachable      no way leads there; carries the nearest place that one leads to
    ├── Misdirected          the session lives in another process of this service
        ├── Aborted              another caller was quicker: a stale revision, a reused request id
    ├── ResourceExhausted    a limit or a quota is reached
    ├── Unauthenticated      no credentials, or none that hold
    ├── PermissionDenied     the caller's scopes do not allow the call
    ├── Unavailable          starting, draining or overloaded: try again
    ├── ArtifactError        a model or body file does not fit its contract
    └── DataError            a motion file is malformed (carries file and line)

A message says what was wrong, where, and what is allowed. `transport/errors.py` holds
the one table that turns these classes into gRPC and HTTP codes. Lengths and places in a message
are quantities, so that transport can write them in the client's basis (`Text`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from wayfarer.endpoint import Endpoint


@dataclass(frozen=True, slots=True)
class Metres:
    """A length, or a height."""

    value: float

    def __str__(self) -> str:
        return f"{self.value:g} m"


@dataclass(frozen=True, slots=True)
class MetresPerSecond:
    """A speed."""

    value: float

    def __str__(self) -> str:
        return f"{self.value:g} m/s"


@dataclass(frozen=True, slots=True)
class Heading:
    """Radians about up, counter-clockwise seen from above."""

    value: float

    def __str__(self) -> str:
        return f"{self.value:g}"


@dataclass(frozen=True, slots=True)
class Place:
    """A point of the world: x, y, z in metres, Z up."""

    coordinates: tuple[float, float, float]

    def __str__(self) -> str:
        return f"({', '.join(f'{value:g}' for value in self.coordinates)})"


Quantity = Metres | MetresPerSecond | Heading | Place
"""A quantity whose text depends on the basis."""


@dataclass(frozen=True, slots=True)
class Text:
    """A sentence for people. `parts` replace its `{}`; without parts it contains none."""

    pattern: str
    parts: tuple[object, ...] = ()

    def __str__(self) -> str:
        return self.pattern.format(*self.parts) if self.parts else self.pattern

    def written(self, quantity: Callable[[Quantity], str]) -> str:
        """The sentence with quantities as `quantity` writes them."""
        parts = (quantity(part) if isinstance(part, Quantity) else part for part in self.parts)
        return str(Text(self.pattern, tuple(parts)))


def spot(point: Sequence[float]) -> Place:
    """A place for a sentence, to the centimetre."""
    x, y, z = (round(float(value), 2) for value in (*point, 0.0)[:3])
    return Place((x, y, z))


def unknown_name(name: str, known: Sequence[str]) -> str:
    """Sentence about an unknown name: the nearest known one, or all of them."""
    if meant := get_close_matches(name, known, n=1):
        return f"unknown; did you mean {meant[0]}?"
    return f"unknown; known are {', '.join(known)}" if known else "unknown; there are none"


class WayfarerError(Exception):
    """Base of all errors raised on purpose."""


class InvalidArgument(WayfarerError):
    """A value is malformed or out of range; `field` names it (dotted path).

    `parts`: as for a `Text`.
    """

    def __init__(self, message: str, field: str = "", *parts: object) -> None:
        self.text = Text(message, parts)
        super().__init__(str(self.text))
        self.field = field


class NotFound(WayfarerError):
    """No such session, agent, body or model; `kind` and `name` say which, where known."""

    def __init__(self, message: str, kind: str = "", name: str = "") -> None:
        super().__init__(message)
        self.kind = kind
        self.name = name


class AlreadyExists(WayfarerError):
    """The name is taken."""


class FailedPrecondition(WayfarerError):
    """The request is well formed, but the state does not allow it now."""


class Unreachable(FailedPrecondition):
    """No way leads to the goal; `nearest` (x, y, z) is the closest place that can be reached.

    `parts`: as for a `Text`.
    """

    def __init__(
        self,
        message: str,
        nearest: tuple[float, float, float],
        *parts: object,
        look: Callable[[], Text | None] = lambda: None,
    ) -> None:
        """`look`: finds the barrier; it may take some tenths of a second."""
        self.text = Text(message, parts)
        super().__init__(str(self.text))
        self.nearest = nearest
        self._look = look

    def explained(self) -> "Unreachable":
        """The same error, with the barrier if it can be found."""
        why, refusal = self._look(), self.text
        if why is None:
            return self
        pattern = f"{refusal.pattern}; {why.pattern}"
        return Unreachable(pattern, self.nearest, *refusal.parts, *why.parts)


class Misdirected(WayfarerError):
    """The session, scene or agent lives in another process of this service."""

    def __init__(self, message: str, endpoint: Endpoint) -> None:
        super().__init__(message)
        self.endpoint = endpoint


class Aborted(WayfarerError):
    """The state has changed since the caller looked: a stale revision, a reused request id."""


class Unauthenticated(WayfarerError):
    """Credentials are missing, malformed, expired or unknown."""


class PermissionDenied(WayfarerError):
    """The caller is known, and its scopes do not allow the call."""


class ResourceExhausted(WayfarerError):
    """A limit is reached; retry after `retry_after` seconds (0: waiting does not help)."""

    def __init__(self, message: str, retry_after: float = 0.0) -> None:
        super().__init__(message)
        self.retry_after = retry_after


class Unavailable(WayfarerError):
    """The service is starting, draining or overloaded."""


class ArtifactError(WayfarerError):
    """A model or body file is missing, damaged, or made for another contract."""


class DataError(WayfarerError):
    """A motion file cannot be read. `line` is 1-based; 0 when no line applies."""

    def __init__(self, message: str, path: str = "", line: int = 0) -> None:
        where = f"{path}:{line}: " if line else f"{path}: " if path else ""
        super().__init__(where + message)
        self.path = path
        self.line = line
