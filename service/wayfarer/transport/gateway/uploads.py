"""Uploads in pieces; their number and size are limited, and so is their memory."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from wayfarer.errors import InvalidArgument, ResourceExhausted

MAX_UPLOADS: Final = 2
"""Maximum number of files that are received at the same time."""

WHOLE_S: Final = 60.0
"""Seconds that one upload may take."""

RETRY_AFTER: Final = 2.0


class Uploads:
    """One per server."""

    def __init__(self, most_bytes: int) -> None:
        self._most = most_bytes
        self._free = MAX_UPLOADS

    @asynccontextmanager
    async def received(self, pieces: AsyncIterator[bytes], field: str) -> AsyncIterator[bytes]:
        """Receives the whole file, which counts while the block runs.

        Raises ResourceExhausted if there are too many uploads, InvalidArgument if the file is too
        large or does not come.
        """
        if not self._free:
            raise ResourceExhausted(
                f"{MAX_UPLOADS} files are being received, as many as may be", RETRY_AFTER
            )
        self._free -= 1
        try:
            yield await self._joined(pieces, field)
        finally:
            self._free += 1

    async def _joined(self, pieces: AsyncIterator[bytes], field: str) -> bytes:
        whole = bytearray()
        try:
            async with asyncio.timeout(WHOLE_S):
                async for piece in pieces:
                    whole += piece
                    if len(whole) > self._most:
                        raise InvalidArgument(f"a mesh has {self._most} bytes at most", field)
        except TimeoutError:
            raise InvalidArgument(f"has not come within {WHOLE_S:g} s", field) from None
        return bytes(whole)
