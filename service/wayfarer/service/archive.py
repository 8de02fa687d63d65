"""What leaves a server and comes back: snapshots and logs, packed off the motion thread."""

import asyncio
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Final, Protocol, TypeVar

from wayfarer.service.persistence.capture import capture_session
from wayfarer.service.persistence.log_format import LogOrigin, decode_log, encode_log
from wayfarer.service.persistence.record import CommandLog
from wayfarer.service.persistence.replay import replay
from wayfarer.service.persistence.replica import seal_replica
from wayfarer.service.persistence.snapshot import decode_session, encode_session
from wayfarer.service.streams.publications import Publication
from wayfarer.service.worlds import Worlds
from wayfarer.world.agents.records import SessionRecord
from wayfarer.world.scenes.populate import CrowdPeople
from wayfarer.world.world import World

T = TypeVar("T")

SETTLE_TRIES: Final = 15
SETTLE_SECONDS: Final = 0.02
"""Tries and pause of an export that waits until chunks planned before the last command are sent,
within 0.1 s of it."""


class Home(Protocol):
    """Where a session lives: `LiveMotion`, or `LockStep`."""

    async def ask(self, call: Callable[[World, float], T]) -> T:
        """Call with its world and time, on its thread."""
        ...


class Archive:
    """Exports and imports sessions of some worlds, and their logs."""

    def __init__(self, worlds: Worlds) -> None:
        self._worlds = worlds
        self._limits = worlds.settings.limits

    async def export_session(self, home: Home, session_id: str) -> bytes:
        """See `MotionService`, as for all below."""
        return (await self._captured(home, session_id))[0]

    async def replica(self, home: Home, session_id: str) -> bytes:
        """What it lives on from when this server has died. Raises NotFound."""
        return seal_replica(*await self._captured(home, session_id))

    async def read_session(self, snapshot: bytes, attributes: Mapping[str, str]) -> SessionRecord:
        """A snapshot's session; `attributes` go before its own.

        Raises InvalidArgument, FailedPrecondition.
        """
        record = await asyncio.to_thread(decode_session, snapshot, self._worlds.body, self._limits)
        own = {**record.spec.attributes, **attributes}
        return replace(record, spec=replace(record.spec, attributes=own))

    async def export_log(self, home: Home, session_id: str) -> bytes:
        """See `MotionService`."""
        log = await home.ask(lambda world, _: self._log(world, session_id))
        return await asyncio.to_thread(encode_log, log, self.origin)

    def replay(self, log: bytes) -> Iterator[Publication]:
        """See `MotionService`."""
        commands = decode_log(log, self.origin, self._limits, self._limits.log_entries)
        yield from replay(commands, self._worlds.solo)

    async def _captured(self, home: Home, session_id: str) -> tuple[bytes, CrowdPeople | None]:
        """Its snapshot, and its crowd of the same moment. Raises NotFound."""
        for _ in range(SETTLE_TRIES):
            if await home.ask(lambda world, _: world.members.is_settled(session_id)):
                break
            await asyncio.sleep(SETTLE_SECONDS)
        (session, agents), crowd = await home.ask(
            lambda world, _: (capture_session(world, session_id), world.crowds.copy(session_id))
        )
        parts = [member.part for member in agents.members]
        body = self._worlds.body
        packed = await asyncio.to_thread(encode_session, session, parts, agents.rows, body)
        return packed, crowd

    def _log(self, world: World, session_id: str) -> CommandLog:
        world.get_session(session_id)
        return self._worlds.recordings.copy(session_id)

    @property
    def origin(self) -> LogOrigin:
        """With what the motion of logs is made here."""
        steering = self._worlds.settings.steering
        asked = max(search.candidates for search in steering.searches.values())
        return LogOrigin(self._worlds.body, self._worlds.models.stamps, asked)
