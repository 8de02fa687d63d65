"""A simulated client: a session of agents, its stream, and goals at a fixed rate."""

import asyncio
import contextlib
import math
import random
import time
from collections.abc import Awaitable, Callable
from typing import TypeVar

import grpc

from wayfarer.v1 import agent_pb2, goal_pb2, session_pb2
from wayfarer_lab.load.plan import LoadPlan
from wayfarer_lab.load.reader import LOST_S, GoalWatch, Reader
from wayfarer_lab.load.tally import Tally
from wayfarer_lab.load.target import Target
from wayfarer_lab.load.wire import Connection, StreamError, followed, node_of

AGENTS_PER_CALL = 64
"""Agents asked for in one call."""

IN_FLIGHT = 256
"""Goal commands of one client that may wait for their answers; more are counted as failed."""

FIRST_GOALS = 2.0
"""Seconds over which first goals are spread: a server takes a limited number of calls at once."""

RECONNECT_SECONDS = 0.5
READY_SECONDS = 10.0

Made = TypeVar("Made")


class SimulatedClient:
    """One session with one healthy stream. Its commands keep their schedule (open loop)."""

    def __init__(self, target: Target, plan: LoadPlan, tally: Tally, number: int) -> None:
        self.target, self._plan, self._tally = target, plan, tally
        self._chance = random.Random(plan.seed * 100_003 + number)
        self._viewpoint = plan.viewpoint(number, tally.failed)
        self._connection = Connection(target)
        self._agents: list[agent_pb2.Agent] = []
        self._commands: set[asyncio.Task[None]] = set()
        self.session_id = ""

    async def open(self) -> None:
        """Creates the session, at the node that takes it, and as many agents as that admits."""
        metadata = self._connection.metadata
        request = session_pb2.CreateSessionRequest(seed=self._chance.getrandbits(32))

        async def create() -> session_pb2.CreateSessionResponse:
            return await self._connection.sessions.CreateSession(request, metadata=metadata)

        try:
            made = await self._when_ready(create)
        except grpc.aio.AioRpcError as error:
            if (node := node_of(error, self.target)) is None:
                raise
            await self._connection.close()
            self.target, self._connection = node, Connection(node)
            made = await self._when_ready(create)
        self.session_id = made.session.session_id
        wanted = self._plan.agents
        while wanted:
            count = min(wanted, AGENTS_PER_CALL)
            wanted -= count
            await self._create(count)

    async def _create(self, count: int) -> None:
        specs = [self._person() for _ in range(count)]
        request = agent_pb2.CreateAgentsRequest(session_id=self.session_id, agents=specs)
        began = time.monotonic()
        try:
            made = await self._when_ready(
                lambda: self._connection.agents.CreateAgents(
                    request, metadata=self._connection.metadata
                )
            )
        except grpc.aio.AioRpcError as error:
            if error.code() is not grpc.StatusCode.RESOURCE_EXHAUSTED:
                raise
            self._tally.refused += count
            self._tally.refusal.add(time.monotonic() - began)
            return
        self._agents += made.agents
        self._tally.agents += len(made.agents)

    async def _when_ready(self, call: Callable[[], Awaitable[Made]]) -> Made:
        """Repeat the call while the server is unavailable, which a starved one may be."""
        until = time.monotonic() + READY_SECONDS
        while True:
            try:
                return await call()
            except grpc.aio.AioRpcError as error:
                if error.code() is not grpc.StatusCode.UNAVAILABLE or time.monotonic() > until:
                    raise
            await asyncio.sleep(RECONNECT_SECONDS)

    def _person(self) -> agent_pb2.AgentSpec:
        return agent_pb2.AgentSpec(
            gender=self._chance.choice([agent_pb2.GENDER_FEMALE, agent_pb2.GENDER_MALE]),
            betas=[self._chance.uniform(-1.5, 1.5) for _ in range(10)],
            position=self._plan.place(self._chance),
            heading=self._chance.uniform(-math.pi, math.pi),
        )

    async def run(self, measuring_from: float, until: float) -> None:
        """Reads the stream and gives goals until `until` (Unix seconds), and counts the end."""
        if not self._agents:
            return
        reader = Reader(self._tally, measuring_from, until)
        reading = asyncio.create_task(self._read(reader))
        giving = asyncio.create_task(self._give_goals(reader.goals, measuring_from))
        try:
            await asyncio.sleep(max(until - time.time(), 0.0))
            giving.cancel()
            await asyncio.sleep(LOST_S)  # time for the last primitives to arrive
        finally:
            reading.cancel()
            giving.cancel()
            ended = await asyncio.gather(reading, giving, return_exceptions=True)
            reader.finish(len(self._agents), time.time())
        for error in ended:
            if isinstance(error, Exception):
                raise error

    async def _read(self, reader: Reader) -> None:
        """Follows the session again whenever the stream ends; its agents keep walking meanwhile."""
        while True:
            messages = followed(
                self._connection,
                self.session_id,
                self._plan.transport,
                self._tally.first_chunk,
                self._viewpoint,
            )
            try:
                async for message in messages:
                    reader.take(message, time.time())
            except StreamError as error:
                self._tally.failed(f"STREAM_{error}")
            await asyncio.sleep(RECONNECT_SECONDS)

    async def _give_goals(self, goals: GoalWatch, measuring_from: float) -> None:
        """Gives every agent a goal, then more at random instants without waiting for answers.

        If the rate is 0, all agents stand.
        """
        rate = self._plan.goal_rate * len(self._agents)
        if not rate:
            return
        for agent in self._agents:
            self._command(agent, goals, time.time(), measuring_from)
            await asyncio.sleep(FIRST_GOALS / len(self._agents))
        due = time.time()
        while True:
            due += self._chance.expovariate(rate)
            await asyncio.sleep(max(due - time.time(), 0.0))
            self._command(self._chance.choice(self._agents), goals, due, measuring_from)

    def _command(
        self, agent: agent_pb2.Agent, goals: GoalWatch, due: float, measuring_from: float
    ) -> None:
        if len(self._commands) >= max(IN_FLIGHT, len(self._agents)):
            self._tally.failed("NOT_SENT")
            return
        watch = goals if due >= measuring_from else None
        task = asyncio.create_task(self._set_goal(agent, watch, due))
        self._commands.add(task)
        task.add_done_callback(self._commands.discard)

    async def _set_goal(self, agent: agent_pb2.Agent, goals: GoalWatch | None, due: float) -> None:
        place = self._plan.place(self._chance)
        goal = goal_pb2.Goal(position=place, speed=self._chance.uniform(0.8, 1.6))
        request = goal_pb2.SetGoalRequest(agent_id=agent.agent_id, goal=goal)
        try:
            reply = await self._connection.goals.SetGoal(
                request, metadata=self._connection.metadata
            )
        except grpc.aio.AioRpcError as error:
            self._tally.failed(error.code().name)
            return
        self._tally.goals += 1
        if goals is not None:
            goals.asked(agent.alias, reply.revision, due)

    async def close(self) -> None:
        """Ends the session."""
        for task in self._commands:
            task.cancel()
        if self.session_id:
            request = session_pb2.DeleteSessionRequest(session_id=self.session_id)
            with contextlib.suppress(grpc.aio.AioRpcError):
                await self._connection.sessions.DeleteSession(
                    request, metadata=self._connection.metadata
                )
        await self._connection.close()
