"""Two async iterators that are read as one."""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator
from typing import Any, TypeVar

Item = TypeVar("Item")
Other = TypeVar("Other")


async def merged(
    main: AsyncIterator[Item], side: AsyncIterator[Other]
) -> AsyncGenerator[Item | Other]:
    """Items of both as they come; each source is read at most one item ahead. Ends with `main`."""
    sources: dict[asyncio.Future[Any], AsyncIterator[Any]] = {}

    def pull(source: AsyncIterator[Any]) -> asyncio.Future[Any]:
        upcoming = asyncio.ensure_future(anext(source))
        sources[upcoming] = source
        return upcoming

    pull(main)
    pull(side)
    try:
        while True:
            done, _ = await asyncio.wait(sources, return_when=asyncio.FIRST_COMPLETED)
            for upcoming in done:
                source = sources.pop(upcoming)
                try:
                    item = upcoming.result()
                except StopAsyncIteration:
                    if source is main:
                        return
                    continue
                yield item
                pull(source)
    finally:
        await _cancel(*sources)


async def _cancel(*futures: asyncio.Future[Any]) -> None:
    for future in futures:
        future.cancel()
    # retrieves the outcomes, so that asyncio reports no exception as unretrieved
    await asyncio.gather(*futures, return_exceptions=True)
