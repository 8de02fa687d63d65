"""The directory behind one door: a method's name and JSON in, JSON out. It has the clock.

Whatever carries the calls (Ray, or one process) carries two texts, and knows nothing of them.
"""

import time
from collections.abc import Callable
from typing import Any, Final, Protocol

from pydantic import TypeAdapter, ValidationError

from wayfarer.cluster.directory import Directory, LeaseRules
from wayfarer.cluster.messages import (
    Answer,
    Changes,
    LeaseRenewal,
    NodeInfo,
    Registration,
    Status,
    Transfer,
    heard,
    problem,
    value,
)
from wayfarer.errors import InvalidArgument, WayfarerError


class DirectoryLink(Protocol):
    """A way to the directory."""

    async def call(self, method: str, body: str) -> str:
        """The answer. Raises Unavailable when the directory is away."""
        ...


class DirectoryService:
    """The directory of a cluster, for links. Not thread-safe."""

    def __init__(self, rules: LeaseRules) -> None:
        self._directory = Directory(rules, time.monotonic(), time.time_ns() // 1000)

    def answer(self, method: str, body: str) -> str:
        """See messages.py."""
        try:
            if method not in METHODS:
                raise InvalidArgument(f"the directory has no method {method!r}")
            call, takes, _ = METHODS[method]
            return value(call(self._directory, takes.validate_json(body), time.monotonic()))
        except ValidationError as error:
            return problem(InvalidArgument(f"{method}: {error.error_count()} fields are wrong"))
        except WayfarerError as error:
            return problem(error)


class LocalLink:
    """To a directory in this process."""

    def __init__(self, rules: LeaseRules) -> None:
        self.service = DirectoryService(rules)

    async def call(self, method: str, body: str) -> str:
        """See `DirectoryLink`."""
        return self.service.answer(method, body)


class DirectoryClient:
    """Typed calls over a link. All raise what the directory raises, and Unavailable."""

    def __init__(self, link: DirectoryLink) -> None:
        self._link = link

    async def register(self, told: Registration) -> Answer:
        """See `Directory`, as for all below."""
        found: Answer = await self._call("register", told)
        return found

    async def renew(self, told: LeaseRenewal) -> Answer:
        """A node is alive."""
        found: Answer = await self._call("renew", told)
        return found

    async def ended(self, name: str) -> None:
        """A node's process has ended."""
        await self._call("ended", name)

    async def place(self, request: str) -> NodeInfo:
        """The node for what is made new."""
        found: NodeInfo = await self._call("place", request)
        return found

    async def changes(self, seen: tuple[int, int]) -> Changes | None:
        """Of the view."""
        found: Changes | None = await self._call("changes", seen)
        return found

    async def transfer(self, told: Transfer) -> int:
        """Give a group away; its new epoch."""
        return int(await self._call("transfer", told))

    async def drain(self, name: str) -> None:
        """Let a node give everything away, and end."""
        await self._call("drain", name)

    async def status(self) -> Status:
        """At a glance."""
        found: Status = await self._call("status", None)
        return found

    async def _call(self, method: str, told: Any) -> Any:
        _, takes, gives = METHODS[method]
        found = heard(await self._link.call(method, takes.dump_json(told).decode()))
        return gives.validate_python(found, strict=False)


Call = Callable[[Directory, Any, float], Any]


def _adapter(of: Any) -> TypeAdapter[Any]:
    return TypeAdapter(of)


METHODS: Final[dict[str, tuple[Call, TypeAdapter[Any], TypeAdapter[Any]]]] = {
    "register": (
        lambda directory, told, now: directory.register(told, now),
        _adapter(Registration),
        _adapter(Answer),
    ),
    "renew": (
        lambda directory, told, now: directory.renew(told, now),
        _adapter(LeaseRenewal),
        _adapter(Answer),
    ),
    "ended": (lambda directory, name, now: directory.ended(name), _adapter(str), _adapter(None)),
    "place": (
        lambda directory, request, now: directory.place(now, request),
        _adapter(str),
        _adapter(NodeInfo),
    ),
    "changes": (
        lambda directory, seen, now: directory.changes(seen),
        _adapter(tuple[int, int]),
        _adapter(Changes | None),
    ),
    "transfer": (
        lambda directory, told, now: directory.transfer(
            told.group, told.owner, told.epoch, told.to, now
        ),
        _adapter(Transfer),
        _adapter(int),
    ),
    "drain": (lambda directory, name, now: directory.drain(name), _adapter(str), _adapter(None)),
    "status": (
        lambda directory, nothing, now: directory.status(now),
        _adapter(None),
        _adapter(Status),
    ),
}
"""By name: what it does, what it takes, what it gives."""
