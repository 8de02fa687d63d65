"""The leases on which clients have sessions and scenes, and what the runtime keeps of them."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument, NotFound
from wayfarer.transport import schema
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.edge.caller import Caller, current_caller
from wayfarer.transport.gateway.session_locator import SessionLocator

VERBS: Final = {"session": "opened", "scene": "made"}

ID_LENGTH: Final = schema.ID_LENGTH

Request = schema.NewSession | schema.NewScene | schema.NewExampleScene


def attributes(request: Request, usual_s: float, limits: Limits) -> dict[str, str]:
    """Attributes that the runtime keeps, for the transport, with what the present caller makes.

    `usual_s` is the lease of a request that names none. Raises InvalidArgument.
    """
    lease_s = min(usual_s, limits.lease_s) if request.lease_s is None else request.lease_s
    if lease_s > limits.lease_s:
        raise InvalidArgument(f"from 1 to {limits.lease_s:g} s, not {lease_s:g}", "lease_s")
    owner = current_caller().name
    return {"owner": owner, "basis": request.basis.value, "lease_s": repr(lease_s)}


@dataclass
class Leased:
    """A session or scene of the runtime, as its clients see it."""

    owner: str
    basis: Basis
    lease_s: float
    expires_at: float  # clock's seconds, without regard to sessions and streams
    endpoint: schema.Endpoint | None  # the only address that takes its calls; None: any


T = TypeVar("T", bound=Leased)


class Leases(Generic[T]):
    """All open sessions, or scenes, by id, and the rights of callers to them."""

    def __init__(
        self, kind: str, limits: Limits, clock: Callable[[], float], locator: SessionLocator
    ) -> None:
        """`kind`: "session" or "scene"."""
        self._kind = kind
        self._limits = limits
        self._clock = clock
        self._locator = locator
        self._open: dict[str, T] = {}
        self._coming: Counter[str] = Counter()  # being made, by owner

    def ids(self) -> list[str]:
        """Ids of all of them."""
        return list(self._open)

    def owned(self, caller: Caller) -> list[T]:
        """The caller's sessions, or scenes, oldest first; an admin sees all."""
        return [one for one in self._open.values() if one.owner == caller.name or caller.is_admin]

    def expired(self) -> list[T]:
        """The sessions, or scenes, whose lease has expired."""
        now = self._clock()
        return [one for one in self._open.values() if one.expires_at < now]

    def renew(self, one: T) -> None:
        """Restarts its lease."""
        one.expires_at = self._clock() + one.lease_s

    def close(self, name: str, one: T | None = None) -> T | None:
        """Forgets the session or scene of this id and returns it. With `one`, only if it still is
        that one: a new one may have the same id. Safe to call twice.
        """
        found = self._open.get(name)
        if found is None or (one is not None and one is not found):
            return None
        return self._open.pop(name)

    def _is_over(self, one: T) -> bool:
        return False

    def _lease(self, found: Mapping[str, str]) -> Leased:
        """A fresh lease by the attributes that the runtime has kept. Raises InvalidArgument."""
        kind = self._kind
        try:
            owner, basis, lease_s = found["owner"], Basis(found["basis"]), float(found["lease_s"])
        except (KeyError, ValueError):
            raise InvalidArgument(
                f"the {kind} was not {VERBS[kind]} by this kind of server"
            ) from None
        if not lease_s >= 1:
            raise InvalidArgument(f"the {kind} has a lease that is too short for this server")
        lease_s = min(lease_s, self._limits.lease_s)
        return Leased(owner, basis, lease_s, self._clock() + lease_s, self._locator.own)

    def _checked(self, found: T | None, kind: str, name: str) -> T:
        """The present caller's. Raises NotFound, Misdirected."""
        caller, name = current_caller(), name[:ID_LENGTH]
        if found is None:
            self._locator.require_own(name)
        if (
            found is None
            or (found.owner != caller.name and not caller.is_admin)
            or self._is_over(found)
        ):
            raise NotFound(f"there is no {kind} {name!r}", kind, name)
        return found


@contextmanager
def counted(coming: Counter[str], owner: str, number: int = 1) -> Iterator[None]:
    """Counts what is being made for an owner."""
    coming[owner] += number
    try:
        yield
    finally:
        coming[owner] -= number
        if not coming[owner]:
            del coming[owner]
