"""A program that ends, and another that resumes where it stopped, without a lost frame.

python clients/python/examples/resume.py [address]
"""

import asyncio
import contextlib
import sys

from wayfarer_client import AgentSpec, Client, MotionStream


async def main(address: str) -> None:
    """Follows an agent through two runs of a program."""
    session_id, token = await first_life(address)
    print("... away for a second; the agent walks on")
    await asyncio.sleep(1.0)
    await second_life(address, session_id, token)


async def first_life(address: str) -> tuple[str, str]:
    """No `async with`, which would delete the session: its lease keeps it."""
    async with Client(address) as client:
        session = await client.create_session(lease=30.0)
        (ada,) = await session.create_agents(AgentSpec(name="Ada"))
        await session.wander(ada, (0.0, 0.0, 0.0), 4.0)
        async with session.stream() as stream:
            await show(stream, 10)
            return session.session_id, stream.resume_token


async def second_life(address: str, session_id: str, token: str) -> None:
    """A session that was joined remains after `async with`, so it is deleted here."""
    async with Client(address) as client, await client.session(session_id) as session:
        async with session.stream(resume_token=token) as stream:
            await show(stream, 10)
            print("resumed without a gap:", stream.info is not None and stream.info.resumed)
        await session.delete()


async def show(stream: MotionStream, chunks: int) -> None:
    """Prints the numbers of `chunks` chunks."""
    async for batch in stream:
        for event in batch.events:
            print(event.kind, event.detail)
        for frames in batch:
            print("chunk", frames.seq)
            chunks -= 1
        if chunks <= 0:
            return


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C ends it
        asyncio.run(main(*sys.argv[1:2] or ["localhost:50051"]))
