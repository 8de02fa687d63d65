"""Files that come in pieces: few at a time, and bounded, so that memory is."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from wayfarer.errors import InvalidArgument, ResourceExhausted

AT_ONCE: Final = 2
"""Files that are being received at a time."""

WHOLE_S: Final = 60.0
"""Seconds that one may take."""

RETRY_AFTER: Final = 2.0


class Uploads:
    """One per server."""

    def __init__(self, most_bytes: int) -> None:
        self._most = most_bytes
        self._free = AT_ONCE

    @asynccontextmanager
    async def received(self, pieces: AsyncIterator[bytes], field: str) -> AsyncIterator[bytes]:
        """The whole file; counted while the block runs.

        Raises ResourceExhausted when others are sending theirs, InvalidArgument when it is too
        large or does not come.
        """
        if not self._free:
            raise ResourceExhausted(
                f"{AT_ONCE} files are being received, as many as may be", RETRY_AFTER
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
