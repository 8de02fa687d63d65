"""Goals and motion over one connection: a new goal each time the last is reached.

python clients/python/examples/control.py [address]
"""

import asyncio
import contextlib
import sys

from wayfarer_client import Aborted, AgentSpec, Client, Goal

CORNERS = [(2.0, 0.0, 0.0), (2.0, 0.0, 2.0), (0.0, 0.0, 2.0), (0.0, 0.0, 0.0)]


async def main(address: str) -> None:
    """Walks around a square."""
    async with Client(address) as client, await client.create_session() as session:
        (ada,) = await session.create_agents(AgentSpec(name="Ada"))
        async with session.control([ada]) as control:
            ahead = list(CORNERS)
            revision = await control.set_goal(ada, Goal(ahead.pop(0), speed=1.4))
            async for batch in control:  # each batch taken is acknowledged, with the playhead
                done = [event for event in batch.events if event.kind == "path_done"]
                if not done or done[0].goal_revision != revision:
                    continue
                print(f"corner {len(CORNERS) - len(ahead)} reached")
                if not ahead:
                    break
                try:  # refused if another client has given her a goal meanwhile
                    revision = await control.set_goal(ada, ahead.pop(0), expected=revision)
                except Aborted as error:
                    print(error)
                    break


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C ends it
        asyncio.run(main(*sys.argv[1:2] or ["localhost:50051"]))
