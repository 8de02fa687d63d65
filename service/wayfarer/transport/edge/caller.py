"""The caller of a call: made by auth/ from credentials, checked by the gateway once per call."""

from contextvars import ContextVar
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from wayfarer.errors import PermissionDenied


class Scope(StrEnum):
    """Permissions of a caller."""

    READ = "read"  # describe and follow
    CONTROL = "control"  # change sessions, agents, goals
    ADMIN = "admin"  # models, drain, all callers' sessions


@dataclass(frozen=True, slots=True)
class Quota:
    """Limits on one caller; None: only the server's limits apply."""

    sessions: int | None = None
    agents: int | None = None
    streams: int | None = None
    calls_per_second: int | None = None  # bursts of twice this number


@dataclass(frozen=True, slots=True)
class Caller:
    """A caller, with any number of connections."""

    name: str  # owner of the sessions it creates; no secret
    scopes: frozenset[Scope]
    quota: Quota = Quota()
    key: bytes = field(default=b"", repr=False)  # SHA-256 of its API key, if it showed one

    def require(self, scope: Scope) -> None:
        """Raises PermissionDenied."""
        if scope not in self.scopes:
            has = ", ".join(sorted(self.scopes)) or "none"
            raise PermissionDenied(
                f"this call needs the scope {scope}; the scopes of {self.name!r} are: {has}"
            )

    @property
    def is_admin(self) -> bool:
        """Whether the caller may see and change the sessions of all callers."""
        return Scope.ADMIN in self.scopes


LOCAL: Final = Caller("local", frozenset(Scope))
"""The caller on a server that asks for no credentials."""

_present: ContextVar[Caller] = ContextVar("caller", default=LOCAL)


def current_caller() -> Caller:
    """The caller of the call being handled; LOCAL if nobody was authenticated."""
    return _present.get()


def enter(caller: Caller) -> None:
    """Handles the rest of this task as a call of `caller`."""
    _present.set(caller)
