"""Sixteen people of differing bodies walk to three goals each; prints every arrival.

python clients/python/examples/walk_sixteen.py [address]
"""

import asyncio
import contextlib
import math
import random
import sys
import time

from wayfarer_client import Agent, AgentSpec, Batch, Client, Flag, Phenotype, Session

PEOPLE = 16
GOALS = 3
DEADLINE_S = 120.0


def person(number: int) -> AgentSpec:
    """A person on a circle of 4 m, facing its centre."""
    chance = random.Random(number)
    angle = 2 * math.pi * number / PEOPLE
    return AgentSpec(
        name=f"walker {number:2d}",
        gender=("female", "male")[number % 2],
        phenotype=Phenotype(
            height_m=chance.uniform(1.55, 1.95),
            weight=chance.uniform(0.2, 0.8),
            muscle=chance.uniform(0.2, 0.8),
            age=chance.uniform(20, 70),
        ),
        position=(4 * math.sin(angle), 0.0, 4 * math.cos(angle)),
        heading=angle - math.pi,  # glTF: heading 0 faces +Z, positive turns towards +X
        seed=number,
    )


def next_goal(agent: Agent, revision: int) -> tuple[float, float, float]:
    """A point 3 to 6 m from the centre, reproducible."""
    chance = random.Random(f"{agent.name} {revision}")
    angle, radius = chance.uniform(0, 2 * math.pi), chance.uniform(3, 6)
    return radius * math.sin(angle), 0.0, radius * math.cos(angle)


async def main(address: str) -> int:
    """Returns the number of people that did not get to all their goals."""
    async with Client(address) as client, await client.create_session() as session:
        people = await session.create_agents(*map(person, range(PEOPLE)))
        for agent in people:
            await session.set_goal(agent, next_goal(agent, 0))
        reached = {agent.agent_id: 0 for agent in people}
        started = time.monotonic()
        try:
            async with asyncio.timeout(DEADLINE_S):
                async for batch in session.stream():
                    await send_on(session, batch, reached, started)
                    if min(reached.values()) == GOALS:
                        break
        except TimeoutError:
            pass
        late = [agent for agent in people if reached[agent.agent_id] < GOALS]
        for agent in late:
            print(f"{agent.name}: only {reached[agent.agent_id]} of {GOALS} goals")
        print(f"{sum(reached.values())} of {PEOPLE * GOALS} goals reached")
        return len(late)


async def send_on(session: Session, batch: Batch, reached: dict[str, int], started: float) -> None:
    """Gives agents that have arrived their next goal."""
    for frames in batch:
        agent = frames.agent
        # a chunk planned for an earlier goal says nothing about the present one
        if Flag.ARRIVED in frames.flags and frames.goal_revision == reached[agent.agent_id] + 1:
            reached[agent.agent_id] += 1
            x, _, z = frames.translation[-1]
            print(
                f"{time.monotonic() - started:6.1f} s  {agent.name} arrived at goal "
                f"{reached[agent.agent_id]} ({x:+.2f}, {z:+.2f})"
            )
            if reached[agent.agent_id] < GOALS:
                goal = next_goal(agent, reached[agent.agent_id])
                await session.set_goal(agent, goal)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C ends it
        sys.exit(asyncio.run(main(*sys.argv[1:2] or ["localhost:50051"])))
