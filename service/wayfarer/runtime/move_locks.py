"""Calls on a session wait while it moves to another server."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Final

from wayfarer.errors import Unavailable, WayfarerError
from wayfarer.ids import group_of

WAIT_S: Final = 5.0
"""Seconds that a call waits for the end of a move."""

CLOSE_S: Final = 2.0
"""Seconds that a move waits for calls in progress."""

POLL_S: Final = 0.005


@dataclass(slots=True)
class _Closed:
    opened: asyncio.Event = field(default_factory=asyncio.Event)
    sessions: int = 0  # number that are moving; a group may have several
    refusal: WayfarerError | None = None


class MoveLocks:
    """One gate for each group of ids (ids.py), which a session and its agents share. Belongs to the
    event loop.
    """

    def __init__(self) -> None:
        self._inside: Counter[str] = Counter()
        self._closed: dict[str, _Closed] = {}

    @asynccontextmanager
    async def through(self, name: str) -> AsyncIterator[None]:
        """Lets a call pass that changes the session, or the agent's session, of this id.

        Raises Misdirected if it has moved meanwhile, Unavailable if that takes too long.
        """
        group = group_of(name)
        while (closed := self._closed.get(group)) is not None:
            try:
                async with asyncio.timeout(WAIT_S):
                    await closed.opened.wait()
            except TimeoutError:
                raise Unavailable("the session is being moved; try again") from None
            if closed.refusal is not None:
                raise closed.refusal
        self._inside[group] += 1
        try:
            yield
        finally:
            self._inside[group] -= 1
            if not self._inside[group]:
                del self._inside[group]

    async def close(self, name: str) -> None:
        """Stops further calls, and waits for those in progress.

        Raises Unavailable, and opens again, if they do not end.
        """
        group = group_of(name)
        self._closed.setdefault(group, _Closed()).sessions += 1
        try:
            async with asyncio.timeout(CLOSE_S):
                while self._inside[group]:
                    await asyncio.sleep(POLL_S)
        except BaseException as error:
            self.open(name)
            if isinstance(error, TimeoutError):
                raise Unavailable("calls on the session do not end; try again") from None
            raise

    def open(self, name: str, refusal: WayfarerError | None = None) -> None:
        """Reopens when called as often as `close`; waiting calls raise `refusal`, if given."""
        group = group_of(name)
        if closed := self._closed.get(group):
            closed.sessions -= 1
            closed.refusal = refusal or closed.refusal
            if not closed.sessions:
                del self._closed[group]
                closed.opened.set()
