"""Snapshots and logs that leave a server or come to it, packed off the motion thread."""

import asyncio
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

from wayfarer.runtime.live import LiveMotion
from wayfarer.runtime.persistence.capture import capture_session
from wayfarer.runtime.persistence.log_format import LogOrigin, decode_log, encode_log
from wayfarer.runtime.persistence.record import CommandLog
from wayfarer.runtime.persistence.replay import replay
from wayfarer.runtime.persistence.session_record import CapturedSession, encode_record
from wayfarer.runtime.persistence.snapshot import decode_session
from wayfarer.runtime.streams.publications import Publication
from wayfarer.runtime.world_factory import WorldFactory
from wayfarer.world.agents.records import SessionRecord
from wayfarer.world.world import World

SETTLE_TRIES: Final = 15
SETTLE_SECONDS: Final = 0.02
"""Tries, and pause between them, of an export that waits for chunks planned before the last
command."""


class SessionExports:
    """Exports and imports sessions of some worlds, and their logs."""

    def __init__(self, worlds: WorldFactory) -> None:
        self._worlds = worlds
        self._limits = worlds.settings.limits

    async def export_session(self, home: LiveMotion, session_id: str) -> bytes:
        """See `MotionService`."""
        for _ in range(SETTLE_TRIES):
            if await home.ask(lambda world, _: world.members.is_settled(session_id)):
                break
            await asyncio.sleep(SETTLE_SECONDS)
        return await self._packed(
            await home.ask(lambda world, _: capture_session(world, session_id))
        )

    async def replica(self, home: LiveMotion, session_id: str) -> bytes:
        """The data from which it resumes after this server has died. Raises NotFound."""
        return await self._packed(
            await home.ask(
                lambda world, _: capture_session(world, session_id)._replace(
                    crowd=world.crowds.copy(session_id)
                )
            )
        )

    async def read_session(self, snapshot: bytes, attributes: Mapping[str, str]) -> SessionRecord:
        """Reads a snapshot's session; `attributes` take precedence over its own.

        Raises InvalidArgument, FailedPrecondition.
        """
        record = await asyncio.to_thread(decode_session, snapshot, self._worlds.body, self._limits)
        own = {**record.spec.attributes, **attributes}
        return replace(record, spec=replace(record.spec, attributes=own))

    async def export_log(self, home: LiveMotion, session_id: str) -> bytes:
        """See `MotionService`."""
        log = await home.ask(lambda world, _: self._log(world, session_id))
        return await asyncio.to_thread(encode_log, log, self.origin)

    def replay(self, log: bytes) -> Iterator[Publication]:
        """See `MotionService`."""
        commands = decode_log(log, self.origin, self._limits, self._limits.log_entries)
        yield from replay(commands, self._worlds.solo)

    async def _packed(self, taken: CapturedSession) -> bytes:
        return await asyncio.to_thread(encode_record, taken, self._worlds.body)

    def _log(self, world: World, session_id: str) -> CommandLog:
        world.get_session(session_id)
        return self._worlds.recordings.copy(session_id)

    @property
    def origin(self) -> LogOrigin:
        """The properties of this server on which the motion of logs depends."""
        steering = self._worlds.settings.steering
        candidates = max(search.candidates for search in steering.searches.values())
        return LogOrigin(self._worlds.body, self._worlds.models.stamps, candidates)
