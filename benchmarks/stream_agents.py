"""Agents that walk from goal to goal, streamed to one client in real time: how late are chunks?

    wayfarer serve &
    python benchmarks/stream_agents.py --agents 64 --seconds 60

Lateness counts from the instant a chunk's first frame is to be shown, by the clock that client and
server share (run both on one machine). A chunk is late when it comes more than one frame (25 ms)
after that instant.
"""

import argparse
import asyncio
import math
import random
import time
from collections.abc import Sequence

from wayfarer_client import Agent, AgentSpec, Client, Flag, Session

LATE_S = 0.025
WARM_UP_S = 5.0


def place(chance: random.Random, radius: float) -> tuple[float, float, float]:
    """A random place in a disc, glTF basis."""
    angle, r = chance.uniform(0, 2 * math.pi), radius * math.sqrt(chance.random())
    return r * math.sin(angle), 0.0, r * math.cos(angle)


async def create(session: Session, count: int, chance: random.Random) -> list[Agent]:
    """People of differing bodies, standing anywhere in a disc of 10 m, all with a goal."""
    specs = [
        AgentSpec(
            gender=("female", "male")[i % 2],
            betas=tuple(chance.uniform(-1.5, 1.5) for _ in range(10)),
            position=place(chance, 10.0),
            heading=chance.uniform(-math.pi, math.pi),
            seed=i,
        )
        for i in range(count)
    ]
    people = await session.create_agents(*specs)
    for agent in people:
        await session.set_goal(agent, place(chance, 10.0))
    return people


async def watch(session: Session, seconds: float, chance: random.Random) -> tuple[list[float], int]:
    """Lateness of every chunk, and the number of goals reached. Arrivals get a new goal."""
    lateness: list[float] = []
    arrivals = 0
    start = time.time()
    async for batch in session.stream():
        now = time.time()
        for frames in batch:
            if now - start > WARM_UP_S:
                lateness.append(now - float(frames.times[0]))
            if Flag.ARRIVED in frames.flags:
                arrivals += 1
                await session.set_goal(frames.agent, place(chance, 10.0))
        if now - start > WARM_UP_S + seconds:
            break
    return lateness, arrivals


def quantile(values: Sequence[float], q: float) -> float:
    """The value below which a share q lies."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(q * len(ordered)))]


async def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else "")
    parser.add_argument("--address", default="localhost:50051")
    parser.add_argument("--agents", type=int, default=64)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    chance = random.Random(given.seed)
    async with Client(given.address) as client, await client.create_session() as session:
        await create(session, given.agents, chance)
        busy = time.process_time()
        lateness, arrivals = await watch(session, given.seconds, chance)
        busy = time.process_time() - busy
    expected = given.agents * given.seconds / 0.2
    late = sum(value > LATE_S for value in lateness)
    print(f"{len(lateness)} chunks of {expected:.0f} expected, {late} late, {arrivals} arrivals")
    shown = " ".join(f"p{100 * q:g} {1000 * quantile(lateness, q):.1f}" for q in (0.5, 0.99, 0.999))
    print(f"lateness ms: {shown} max {1000 * max(lateness):.1f}")
    print(f"client CPU: {busy / (given.seconds + WARM_UP_S):.0%} of a core")


if __name__ == "__main__":
    asyncio.run(main())
