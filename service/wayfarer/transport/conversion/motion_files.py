"""Publications as a motion file."""

import asyncio
from collections.abc import AsyncGenerator, Iterator
from contextlib import aclosing, contextmanager
from dataclasses import replace
from typing import Final

from wayfarer.clips.clip import Array, join_chunks
from wayfarer.clips.files import FileOptions, Performance, encode
from wayfarer.errors import InvalidArgument
from wayfarer.runtime.motion_service import MotionService
from wayfarer.runtime.streams.publications import Publication, SlowReader, StreamOptions
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentInfo, MotionChunk

PART_BYTES: Final = 1 << 20
"""Maximum bytes of one message of a file."""
PATIENCE_S: Final = 5.0
"""Seconds that a recording waits for late motion."""
MAX_FRAMES: Final = 3600 * FPS
"""Maximum frames of all people in a file: an hour of one person."""


async def motion_file(
    made: AsyncGenerator[Publication],
    options: FileOptions,
    body: str,
    title: str,
    scene: Array | None = None,
) -> bytes:
    """Writes the motion of all agents to one file; `made` is closed.

    Raises InvalidArgument if the format cannot hold them, or the motion is too long for a file.
    """
    people = await performances(made, body)
    with file_fields():
        return await asyncio.to_thread(encode, people, options, title, scene)


@contextmanager
def file_fields() -> Iterator[None]:
    """Names fields of a MotionFile as in a request, in which it is the field `file`."""
    try:
        yield
    except InvalidArgument as error:
        if error.field not in FileOptions.__dataclass_fields__:
            raise
        raise InvalidArgument(str(error), f"file.{error.field}") from None


async def performances(made: AsyncGenerator[Publication], body: str) -> list[Performance]:
    """Collects each agent's motion; `made` is closed. Raises InvalidArgument if it is too long."""
    infos: dict[int, AgentInfo] = {}
    chunks: dict[int, list[MotionChunk]] = {}
    frames = 0
    async with aclosing(made):
        async for published in made:
            infos |= {info.alias: info for info in published.added}
            for chunk in published.chunks:
                chunks.setdefault(chunk.alias, []).append(chunk)
                frames += len(chunk.translation)
            if frames > MAX_FRAMES:
                raise InvalidArgument(
                    f"the motion is longer than a file may be: {MAX_FRAMES / FPS:g} s of all "
                    "people together",
                    "file",
                )
    start = min((own[0].scheduled_at for own in chunks.values()), default=0.0)
    return [
        Performance(
            name=infos[alias].spec.name or f"person {alias}",
            clip=join_chunks(own, infos[alias].spec, body=body),
            style=infos[alias].spec.noise_seed,
            outfit=infos[alias].spec.outfit,
            start=own[0].scheduled_at - start,
        )
        for alias, own in sorted(chunks.items())
    ]


async def live_motion(
    service: MotionService, session_id: str, seconds: float
) -> AsyncGenerator[Publication]:
    """Yields the next seconds of a session's motion, with its agents.

    Raises NotFound; ResourceExhausted if this reader is too slow to receive everything.
    """
    known = {info.alias: info for info in await service.list_agents(session_id)}
    described: set[int] = set()
    options = StreamOptions(slow_reader=SlowReader.DISCONNECT)
    subscription = await service.subscribe(session_id, options)
    end: float | None = None
    try:
        # a session without agents has no motion, so only the clock ends the recording
        async with asyncio.timeout(seconds + PATIENCE_S):
            async for published in subscription:
                end = end if end is not None else published.scheduled_at + seconds
                if published.scheduled_at >= end - 1e-6:
                    return
                new = {int(alias) for alias in published.chunks.alias} - described
                if not new <= known.keys():
                    known |= {info.alias: info for info in await service.list_agents(session_id)}
                described |= new
                yield replace(published, added=tuple(known[alias] for alias in sorted(new)))
    except TimeoutError:
        return  # with the motion so far
    finally:
        await subscription.close()


def parts_of(data: bytes) -> Iterator[bytes]:
    """The file in parts."""
    for begin in range(0, len(data), PART_BYTES):
        yield data[begin : begin + PART_BYTES]
