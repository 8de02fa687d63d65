"""Motion for a renderer or a test, where each call advances time. Writes an npz per person.

python clients/python/examples/lock_step.py [folder] [address]
"""

import asyncio
import contextlib
import sys
from pathlib import Path

from wayfarer_client import AgentSpec, Batch, Client, Goal, tracks


async def main(folder: str, address: str) -> None:
    """Two people cross; the same seeds give the same motion each time."""
    async with (
        Client(address) as client,
        await client.create_session(seed=7, lock_step=True) as session,
    ):
        ada, bo = await session.create_agents(
            AgentSpec(name="ada"), AgentSpec(name="bo", gender="male", position=(2.0, 0.0, 0.0))
        )
        await session.set_path(ada, [Goal((0.0, 0.0, 2.0), stop=False), Goal((1.0, 0.0, 4.0))])
        await session.set_goal(bo, (-1.0, 0.0, 3.0))
        batches: list[Batch] = []
        for _ in range(6):
            batches += await session.step(5)  # a second
    for track in tracks(batches).values():
        print(track.save(Path(folder) / track.agent.name), track.rotations.shape)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C ends it
        asyncio.run(main(*(sys.argv[1:] + [".", "localhost:50051"][len(sys.argv) - 1 :])))
