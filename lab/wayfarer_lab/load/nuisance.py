"""Misbehaving readers: some too slow, some that vanish, each next to a healthy stream."""

import asyncio
import random

from wayfarer_lab.load.plan import LoadPlan
from wayfarer_lab.load.tally import Tally
from wayfarer_lab.load.target import Target
from wayfarer_lab.load.wire import Connection, StreamError, followed

SLOW_SECONDS = 5.0
VANISH_SECONDS = 1.0


class Nuisance:
    """One more reader of a session."""

    def __init__(
        self, target: Target, plan: LoadPlan, tally: Tally, session_id: str, number: int
    ) -> None:
        self._target, self._plan, self._tally = target, plan, tally
        self._session_id = session_id
        self._chance = random.Random(plan.seed * 100_003 - number)

    async def read_slowly(self) -> None:
        """Take a message every few seconds; reconnect when the server ends the stream."""
        while True:
            connection = Connection(self._target)
            try:
                async for _ in connection.stream(self._session_id, self._plan.transport):
                    await asyncio.sleep(SLOW_SECONDS)
            except StreamError:
                self._tally.failed("SLOW_READER_ENDED")
            finally:
                await connection.close()
            await asyncio.sleep(SLOW_SECONDS)

    async def vanish(self) -> None:
        """Open streams and cut them off, one after the other."""
        while True:
            connection = Connection(self._target)
            reading = asyncio.create_task(self._glance(connection))
            try:
                await asyncio.sleep(VANISH_SECONDS * self._chance.uniform(0.2, 1.8))
            finally:
                reading.cancel()
                await asyncio.gather(reading, return_exceptions=True)
                await connection.close()

    async def _glance(self, connection: Connection) -> None:
        messages = followed(
            connection, self._session_id, self._plan.transport, self._tally.first_chunk
        )
        async for _ in messages:
            pass
