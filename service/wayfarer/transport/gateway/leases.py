"""The lease on which a client has a session or a scene, and what the runtime keeps of it."""

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Final

from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument
from wayfarer.transport import schema
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.edge.caller import current_caller

VERBS: Final = {"session": "opened", "scene": "made"}

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


def read_attributes(
    kind: str, found: Mapping[str, str], limits: Limits
) -> tuple[str, Basis, float]:
    """Owner, basis, lease. Raises InvalidArgument."""
    try:
        owner, basis, lease_s = found["owner"], Basis(found["basis"]), float(found["lease_s"])
    except (KeyError, ValueError):
        raise InvalidArgument(f"the {kind} was not {VERBS[kind]} by this kind of server") from None
    if not lease_s >= 1:
        raise InvalidArgument(f"the {kind} has a lease that is too short for this server")
    return owner, basis, min(lease_s, limits.lease_s)


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
