"""The first checks of every call, on both transports: caller, rate, and its name in logs."""

import secrets
from dataclasses import dataclass, field
from functools import partial

import structlog

from wayfarer.errors import Unauthenticated
from wayfarer.transport.auth import Authenticator, Credentials
from wayfarer.transport.edge import call_rates as limits
from wayfarer.transport.edge import caller as callers
from wayfarer.transport.edge.call_rates import CallRates
from wayfarer.transport.edge.caller import Caller

log = structlog.get_logger(__name__)

REQUEST_ID_LENGTH = 64


@dataclass(frozen=True, slots=True)
class Guard:
    """One per server."""

    authenticator: Authenticator = field(default_factory=Authenticator)
    rates: CallRates = field(default_factory=lambda: CallRates(100))

    async def authenticate(self, shown: Credentials, address: str) -> Caller:
        """Returns the caller. `address`: of the other end, without port.

        Raises Unauthenticated; ResourceExhausted after too many failures; Unavailable.
        """
        try:
            return await self.authenticator.caller(shown)
        except Unauthenticated as error:
            self.rates.failed(address)
            log.info("call refused", address=address, reason=str(error))
            raise

    async def admit(self, shown: Credentials, address: str) -> Caller:
        """Admits a call, and handles the rest of this task as its caller's.

        Raises what `authenticate` raises, and ResourceExhausted beyond the caller's rate.
        """
        caller = await self.authenticate(shown, address)
        self.rates.count(caller)
        callers.enter(caller)
        limits.count_with(partial(self.rates.count, caller))
        structlog.contextvars.bind_contextvars(caller=caller.name)
        return caller


def begin(request_id: str) -> str:
    """Starts the log context of a call; returns its id, the client's if valid or a new one."""
    structlog.contextvars.clear_contextvars()
    known = 0 < len(request_id) <= REQUEST_ID_LENGTH and all(
        c.isascii() and (c.isalnum() or c in "-_.") for c in request_id
    )
    kept = request_id if known else secrets.token_hex(8)
    structlog.contextvars.bind_contextvars(request_id=kept)
    return kept
