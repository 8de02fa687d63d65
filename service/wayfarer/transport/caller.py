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
    ADMIN = "admin"  # models, drain, everybody's sessions


@dataclass(frozen=True, slots=True)
class Quota:
    """What one caller may hold at a time; None: as much as the server's limits let it."""

    sessions: int | None = None
    agents: int | None = None
    streams: int | None = None
    calls_per_second: int | None = None  # bursts of twice as many


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
        """Sees and changes everybody's sessions."""
        return Scope.ADMIN in self.scopes


LOCAL: Final = Caller("local", frozenset(Scope))
"""Anybody, where the server asks for no credentials."""

_present: ContextVar[Caller] = ContextVar("caller", default=LOCAL)


def current_caller() -> Caller:
    """The caller of the call being handled; LOCAL where nobody was authenticated."""
    return _present.get()


def enter(caller: Caller) -> None:
    """Handle the rest of this task as a call of `caller`."""
    _present.set(caller)
