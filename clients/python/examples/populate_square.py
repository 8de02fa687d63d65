"""A town square full of people, and a person who must cross it.

python clients/python/examples/populate_square.py [address] [people]
"""

import asyncio
import contextlib
import sys

from wayfarer_client import AgentSpec, Box, Client


async def main(address: str = "localhost:50051", people: str = "20") -> None:
    """Prints what happens on the way."""
    async with Client(address) as client:
        square = await client.scenes.example("town_square")
        print(f"{square.message.area_m2:.0f} m² to walk on")
        async with await client.create_session(scene=square) as session:
            crowd = await session.populate(int(people), seed=7)
            print(f"{crowd.came} people have come")
            if crowd.waiting:
                print(f"{crowd.waiting} wait: {crowd.reason}")
            (ada,) = await session.create_agents(AgentSpec(name="Ada", position=(-7, 0, 0)))
            # a crate falls right in front of her before she starts
            crate = Box(position=(-5.5, 0, 0), size=(0.8, 1.0, 2.4))
            print(f"version {await square.put('crate', crate)} of the square")
            way = await square.path((-7, 0, 0), (0, 0, 0))
            print(
                f"her way is {way.length:.1f} m long, and ends {way.goal_moved:.1f} m from its goal"
            )
            # into the fountain: she goes to its edge
            await session.set_goal(ada, (0, 0, 0))
            async for batch in session.stream([ada]):
                for event in batch.events:
                    print(event.kind, event.detail)
                if any(event.kind == "path_done" for event in batch.events):
                    break
        await square.delete()


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C ends it
        asyncio.run(main(*sys.argv[1:]))
