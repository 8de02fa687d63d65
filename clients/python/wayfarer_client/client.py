"""The asynchronous client."""

import asyncio
import time
from collections.abc import AsyncGenerator, Iterable
from contextlib import aclosing
from types import TracebackType
from typing import Any, Final, Self

import grpc

from wayfarer_client.errors import NotFound, Unavailable, WayfarerError, from_grpc
from wayfarer_client.messages import (
    Agent,
    AgentSpec,
    Batch,
    Goal,
    Place,
    agent_from_wire,
    enum_label,
    frames_from_wire,
)
from wayfarer_client.v1 import (
    agent_pb2,
    agent_pb2_grpc,
    catalog_pb2,
    catalog_pb2_grpc,
    common_pb2,
    goal_pb2,
    goal_pb2_grpc,
    motion_pb2,
    motion_pb2_grpc,
    session_pb2,
    session_pb2_grpc,
)

BACKOFF_S: Final = (0.1, 2.0)
"""First and longest pause between attempts to reconnect; doubled in between."""

SILENCE_S: Final = 5.0
"""A stream without even a heartbeat (one per second) for so long is dead."""

OPTIONS: Final = [
    ("grpc.keepalive_time_ms", 20_000),
    ("grpc.keepalive_timeout_ms", 10_000),
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 2_000),
    # Let a reader that is too slow be seen by the server, which then drops old frames, instead
    # of piling up minutes of motion in this process.
    ("grpc.http2.lookahead_bytes", 64 * 1024),
    ("grpc.max_receive_message_length", 16 * 1024 * 1024),
]


class Client:
    """A connection to a server. Use it as `async with`, or call `connect` and `close`."""

    def __init__(self, address: str = "localhost:50051", timeout: float = 10.0) -> None:
        """`timeout`: seconds for connecting and for each call."""
        self.address = address
        self.timeout = timeout
        self._channel = grpc.aio.insecure_channel(address, options=OPTIONS)
        # The generated stubs are typed for the synchronous API only.
        self._sessions: Any = session_pb2_grpc.SessionServiceStub(self._channel)
        self._agents: Any = agent_pb2_grpc.AgentServiceStub(self._channel)
        self._goals: Any = goal_pb2_grpc.GoalServiceStub(self._channel)
        self._motion: Any = motion_pb2_grpc.MotionServiceStub(self._channel)
        self._catalog: Any = catalog_pb2_grpc.CatalogServiceStub(self._channel)

    async def connect(self) -> Self:
        """Wait until the server answers. Raises Unavailable."""
        try:
            async with asyncio.timeout(self.timeout):
                await self._channel.channel_ready()
        except TimeoutError:
            await self.close()
            raise Unavailable(f"no server at {self.address} within {self.timeout:g} s") from None
        return self

    async def close(self) -> None:
        """Close the connection. Sessions live on until they are deleted or idle too long."""
        await self._channel.close(None)

    async def __aenter__(self) -> Self:
        return await self.connect()

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.close()

    async def create_session(self, basis: str = "gltf") -> "Session":
        """Open a session; basis: gltf, unity, unreal, unreal_mannequin, blender or ros."""
        label = enum_label(common_pb2.Basis, basis, "basis")
        request = session_pb2.CreateSessionRequest(basis=label)
        reply = await self._call(self._sessions.CreateSession, request)
        return Session(self, reply.session.session_id)

    async def session(self, session_id: str) -> "Session":
        """Take part in a session that exists. Raises NotFound."""
        request = session_pb2.GetSessionRequest(session_id=session_id)
        await self._call(self._sessions.GetSession, request)
        return Session(self, session_id)

    async def server_info(self) -> catalog_pb2.GetServerInfoResponse:
        """Version, frame rate, limits, bases."""
        return await self._call(self._catalog.GetServerInfo, catalog_pb2.GetServerInfoRequest())

    async def skeleton(self) -> catalog_pb2.Skeleton:
        """Bones, parents, and names in common engines."""
        request = catalog_pb2.GetSkeletonRequest()
        return (await self._call(self._catalog.GetSkeleton, request)).skeleton

    async def bodies(self) -> list[catalog_pb2.Body]:
        """Bodies that agents can have."""
        reply = await self._call(self._catalog.ListBodies, catalog_pb2.ListBodiesRequest())
        return list(reply.bodies)

    async def models(self) -> list[catalog_pb2.Model]:
        """Motion models that are loaded."""
        reply = await self._call(self._catalog.ListModels, catalog_pb2.ListModelsRequest())
        return list(reply.models)

    async def _call(self, method: Any, request: Any) -> Any:
        try:
            return await method(request, timeout=self.timeout)
        except grpc.aio.AioRpcError as error:
            raise from_grpc(error) from None


class Session:
    """A set of agents. As `async with`, it is deleted at the end."""

    def __init__(self, client: Client, session_id: str) -> None:
        self.client = client
        self.session_id = session_id

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            await self.delete()
        except (NotFound, Unavailable):
            if error is None:
                raise

    async def delete(self) -> None:
        """End the session, its agents and its streams."""
        request = session_pb2.DeleteSessionRequest(session_id=self.session_id)
        await self.client._call(self.client._sessions.DeleteSession, request)

    async def create_agents(self, *specs: AgentSpec) -> list[Agent]:
        """Create agents, all or none."""
        request = agent_pb2.CreateAgentsRequest(
            session_id=self.session_id, agents=[spec.to_wire() for spec in specs]
        )
        reply = await self.client._call(self.client._agents.CreateAgents, request)
        return [agent_from_wire(agent) for agent in reply.agents]

    async def agents(self) -> list[Agent]:
        """All agents of the session as they are now."""
        request = agent_pb2.ListAgentsRequest(session_id=self.session_id)
        reply = await self.client._call(self.client._agents.ListAgents, request)
        return [agent_from_wire(agent) for agent in reply.agents]

    async def agent(self, agent: Agent | str) -> Agent:
        """One agent as it is now."""
        request = agent_pb2.GetAgentRequest(agent_id=_id(agent))
        return agent_from_wire(
            (await self.client._call(self.client._agents.GetAgent, request)).agent
        )

    async def delete_agent(self, agent: Agent | str) -> None:
        """Remove an agent."""
        request = agent_pb2.DeleteAgentRequest(agent_id=_id(agent))
        await self.client._call(self.client._agents.DeleteAgent, request)

    async def set_goal(
        self,
        agent: Agent | str,
        position: Place,
        radius: float | None = None,
        speed: float | None = None,
        heading: float | None = None,
        stop: bool = True,
        strafe: bool = False,
    ) -> int:
        """Send an agent somewhere, see `Goal`; return the goal's revision."""
        goal = Goal(position, radius, speed, heading, stop, strafe).to_wire()
        request = goal_pb2.SetGoalRequest(agent_id=_id(agent), goal=goal)
        return int((await self.client._call(self.client._goals.SetGoal, request)).revision)

    async def set_path(self, agent: Agent | str, goals: Iterable[Goal]) -> int:
        """Send an agent to goals in turn; return their revision."""
        wire = [goal.to_wire() for goal in goals]
        request = goal_pb2.SetPathRequest(agent_id=_id(agent), goals=wire)
        return int((await self.client._call(self.client._goals.SetPath, request)).revision)

    async def clear_goal(self, agent: Agent | str) -> int:
        """Stop an agent where it is; return the revision."""
        request = goal_pb2.ClearGoalRequest(agent_id=_id(agent))
        return int((await self.client._call(self.client._goals.ClearGoal, request)).revision)

    async def stream(
        self, agents: Iterable[Agent | str] = (), deadline: float = 30.0
    ) -> AsyncGenerator[Batch]:
        """Follow the agents named, or all of the session, until the session ends.

        A lost connection is made again, for `deadline` seconds from the last sign of life; then
        Unavailable is raised. After a reconnection agents start with Flag.FIRST.
        Raises NotFound when there is no such session, or no longer.
        """
        request = motion_pb2.StreamMotionRequest(
            session_id=self.session_id, agent_ids=[_id(agent) for agent in agents]
        )
        heard, pause = time.monotonic(), BACKOFF_S[0]
        while True:
            try:
                async with aclosing(self._stream_once(request)) as batches:
                    async for batch in batches:
                        heard, pause = time.monotonic(), BACKOFF_S[0]
                        if batch is not None:
                            yield batch
                return
            except Unavailable as error:
                left = heard + deadline - time.monotonic()
                if left <= 0:
                    raise Unavailable(f"no stream for {deadline:g} s: {error}") from None
                await asyncio.sleep(min(pause, left))
                pause = min(2 * pause, BACKOFF_S[1])

    async def _stream_once(
        self, request: motion_pb2.StreamMotionRequest
    ) -> AsyncGenerator[Batch | None]:
        """Batches of one connection; None for other signs of life."""
        call = self.client._motion.StreamMotion(request)
        known: dict[int, Agent] = {}
        header = motion_pb2.StreamHeader()
        try:
            while True:
                async with asyncio.timeout(SILENCE_S):
                    message = await call.read()
                if message is grpc.aio.EOF:  # type: ignore[attr-defined]
                    return
                if message.HasField("header"):
                    header = _checked(message.header)
                yield _batch(message, header, known) if message.HasField("batch") else None
        except TimeoutError:
            raise Unavailable(f"nothing heard for {SILENCE_S:g} s") from None
        except grpc.aio.AioRpcError as error:
            raise from_grpc(error) from None
        finally:
            call.cancel()


def _batch(
    message: motion_pb2.StreamMotionResponse,
    header: motion_pb2.StreamHeader,
    known: dict[int, Agent],
) -> Batch:
    batch = message.batch
    added = tuple(agent_from_wire(agent) for agent in batch.added)
    known.update((agent.alias, agent) for agent in added)
    frames = tuple(
        frames_from_wire(chunk, known, header.fps, header.skeleton.posed_bones)
        for chunk in batch.chunks
    )
    removed = tuple(known.pop(alias) for alias in batch.removed)
    return Batch(message.sent_at_us / 1e6, frames, added, removed)


def _checked(header: motion_pb2.StreamHeader) -> motion_pb2.StreamHeader:
    """Raises WayfarerError when this client cannot read the poses."""
    if header.pose_encoding != motion_pb2.POSE_ENCODING_F32_LE:
        raise WayfarerError(
            f"server {header.server_version} sends pose encoding {header.pose_encoding}, "
            "which this client does not know: update wayfarer-client"
        )
    return header


def _id(agent: Agent | str) -> str:
    return agent if isinstance(agent, str) else agent.agent_id
