"""A first stream in ten lines: somebody walks to a goal.

python clients/python/examples/first_stream.py [address]
"""

import asyncio
import contextlib
import sys

from wayfarer_client import AgentSpec, Client


async def main(address: str) -> None:
    """Prints where she is until she is there."""
    async with Client(address) as client, await client.create_session() as session:
        (ada,) = await session.create_agents(AgentSpec(name="Ada"))
        await session.set_goal(ada, (2.0, 0.0, 3.0))
        async for batch in session.stream():
            for frames in batch:
                print(frames.state, frames.translation[-1])  # [F, 3]; rotations are [F, 22, 4]
            if any(event.kind == "path_done" for event in batch.events):
                break


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C ends it
        asyncio.run(main(*sys.argv[1:2] or ["localhost:50051"]))
