"""A simulated client: a session of agents, its stream, and goals at a fixed rate."""

import asyncio
import contextlib
import math
import random
import time

import grpc

from wayfarer.load.plan import Plan
from wayfarer.load.reader import Reader
from wayfarer.load.tally import Tally
from wayfarer.load.target import Target
from wayfarer.load.wire import Connection
from wayfarer.v1 import agent_pb2, common_pb2, goal_pb2, session_pb2

AT_ONCE = 64
"""Agents asked for in one call."""

IN_FLIGHT = 256
"""Goal commands of one client that may wait for their answers; more are counted as failed."""

SLOW_SECONDS = 5.0
VANISH_SECONDS = 1.0


class SimulatedClient:
    """One session with one healthy stream. Its commands keep their schedule (open loop)."""

    def __init__(self, target: Target, plan: Plan, tally: Tally, number: int) -> None:
        self._target, self._plan, self._tally = target, plan, tally
        self._chance = random.Random(plan.seed * 100_003 + number)
        self._connection = Connection(target)
        self._agents: list[agent_pb2.Agent] = []
        self._commands: set[asyncio.Task[None]] = set()
        self.session_id = ""

    async def open(self) -> None:
        """Create the session and as many agents as the server admits."""
        metadata = self._connection.metadata
        request = session_pb2.CreateSessionRequest(seed=self._chance.getrandbits(32))
        made = await self._connection.sessions.CreateSession(request, metadata=metadata)
        self.session_id = made.session.session_id
        wanted = self._plan.agents
        while wanted:
            count = min(wanted, AT_ONCE)
            wanted -= count
            await self._create(count)

    async def _create(self, count: int) -> None:
        specs = [self._person() for _ in range(count)]
        request = agent_pb2.CreateAgentsRequest(session_id=self.session_id, agents=specs)
        began = time.monotonic()
        try:
            made = await self._connection.agents.CreateAgents(
                request, metadata=self._connection.metadata
            )
        except grpc.aio.AioRpcError as error:
            if error.code() is not grpc.StatusCode.RESOURCE_EXHAUSTED:
                raise
            self._tally.refused += count
            self._tally.refusal.add(time.monotonic() - began)
            return
        self._agents += made.agents
        self._tally.agents += len(made.agents)

    def _person(self) -> agent_pb2.AgentSpec:
        return agent_pb2.AgentSpec(
            gender=self._chance.choice([agent_pb2.GENDER_FEMALE, agent_pb2.GENDER_MALE]),
            betas=[self._chance.uniform(-1.5, 1.5) for _ in range(10)],
            position=self._place(),
            heading=self._chance.uniform(-math.pi, math.pi),
        )

    def _place(self) -> common_pb2.Vector3:
        angle = self._chance.uniform(0, 2 * math.pi)
        reach = self._plan.area * math.sqrt(self._chance.random())
        return common_pb2.Vector3(x=reach * math.sin(angle), z=reach * math.cos(angle))

    async def run(self, measuring_from: float, until: float) -> None:
        """Read the stream and give goals until `until` (Unix seconds)."""
        if not self._agents:
            return
        reader = Reader(self._tally, measuring_from)
        async with asyncio.TaskGroup() as tasks:
            reading = tasks.create_task(self._read(reader))
            goals = tasks.create_task(self._give_goals(reader))
            await asyncio.sleep(max(until - time.time(), 0.0))
            reading.cancel()
            goals.cancel()

    async def _read(self, reader: Reader) -> None:
        began, first = time.monotonic(), True
        async for message in self._connection.stream(self.session_id, self._plan.transport):
            reader.take(message, time.time())
            if first and message.HasField("batch"):
                self._tally.first_chunk.add(time.monotonic() - began)
                first = False

    async def _give_goals(self, reader: Reader) -> None:
        for agent in self._agents:  # everybody sets out
            self._command(agent, reader)
        rate = self._plan.goal_rate * len(self._agents)
        due = time.monotonic()
        while rate > 0:
            due += self._chance.expovariate(rate)
            await asyncio.sleep(max(due - time.monotonic(), 0.0))
            self._command(self._chance.choice(self._agents), reader)

    def _command(self, agent: agent_pb2.Agent, reader: Reader) -> None:
        if len(self._commands) >= max(IN_FLIGHT, len(self._agents)):
            self._tally.failed("NOT_SENT")
            return
        task = asyncio.create_task(self._set_goal(agent, reader))
        self._commands.add(task)
        task.add_done_callback(self._commands.discard)

    async def _set_goal(self, agent: agent_pb2.Agent, reader: Reader) -> None:
        goal = goal_pb2.Goal(position=self._place(), speed=self._chance.uniform(0.8, 1.6))
        request = goal_pb2.SetGoalRequest(agent_id=agent.agent_id, goal=goal)
        since = time.time()
        try:
            reply = await self._connection.goals.SetGoal(
                request, metadata=self._connection.metadata
            )
        except grpc.aio.AioRpcError as error:
            self._tally.failed(error.code().name)
            return
        self._tally.goals += 1
        if since >= reader.measuring_from:
            reader.asked(agent.alias, reply.revision, since)

    async def read_slowly(self) -> None:
        """Another stream of the session, whose reader takes a message every few seconds."""
        connection = Connection(self._target)
        try:
            async for _ in connection.stream(self.session_id, self._plan.transport):
                await asyncio.sleep(SLOW_SECONDS)
        except (grpc.aio.AioRpcError, OSError):  # the server may well have had enough of it
            self._tally.failed("SLOW_READER_ENDED")
        finally:
            await connection.close()

    async def vanish(self) -> None:
        """Streams of the session that are cut off without a word, one after the other."""
        while True:
            connection = Connection(self._target)
            reading = asyncio.create_task(self._glance(connection))
            try:
                await asyncio.sleep(VANISH_SECONDS * self._chance.uniform(0.2, 1.8))
            finally:
                reading.cancel()
                await asyncio.gather(reading, return_exceptions=True)
                await connection.close()

    async def _glance(self, connection: Connection) -> None:
        async for _ in connection.stream(self.session_id, self._plan.transport):
            pass

    async def close(self) -> None:
        """End the session."""
        for task in self._commands:
            task.cancel()
        if self.session_id:
            request = session_pb2.DeleteSessionRequest(session_id=self.session_id)
            with contextlib.suppress(grpc.aio.AioRpcError):
                await self._connection.sessions.DeleteSession(
                    request, metadata=self._connection.metadata
                )
        await self._connection.close()
