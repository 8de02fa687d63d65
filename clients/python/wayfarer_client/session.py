"""A session: agents, goals, motion."""

import asyncio
from collections.abc import Iterable
from types import TracebackType
from typing import Final, Self

from google.protobuf.message import Message

from wayfarer_client.connection import Connection
from wayfarer_client.control import Control
from wayfarer_client.errors import NotFound, Unavailable, WayfarerError
from wayfarer_client.goals import GoalCommands, id_of
from wayfarer_client.messages import (
    Agent,
    AgentSpec,
    Batch,
    CrowdCame,
    Interest,
    MotionFile,
    PoseFormat,
    enum_label,
)
from wayfarer_client.page import page_of, show
from wayfarer_client.poses import PoseLayout
from wayfarer_client.stream import MotionStream
from wayfarer_client.v1 import (
    agent_pb2,
    common_pb2,
    motion_pb2,
    scene_pb2,
    session_pb2,
    snapshot_pb2,
)
from wayfarer_client.wire import BatchReader, agent_from_wire

RENEWALS_PER_LEASE: Final = 3
STEP_TIMEOUT_S: Final = 120.0


class Session(GoalCommands):
    """A set of agents. `async with` renews its lease meanwhile.

    At its end, a session that this client created is deleted; a session that it joined remains.
    """

    def __init__(self, connection: Connection, message: session_pb2.Session, owned: bool) -> None:
        """`connection`: the channel for its calls."""
        self.session_id = message.session_id
        self.basis: common_pb2.BasisInfo = message.basis
        self.seed = message.seed
        self.lease_s = message.lease_s
        self.owned = owned
        self._connection = connection
        self._renewing: asyncio.Task[None] | None = None
        self._known: dict[int, Agent] = {}  # agents of lock-step, by alias

    async def __aenter__(self) -> Self:
        if self.lease_s > 0:
            self._renewing = asyncio.create_task(self._keep_alive(), name="wayfarer lease")
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._renewing is not None:
            self._renewing.cancel()
            await asyncio.wait({self._renewing})
        if not self.owned:
            return
        try:
            await self.delete()
        except (NotFound, Unavailable):
            if error is None:
                raise

    async def _keep_alive(self) -> None:
        """Renews the lease until the session has ended, which its next call reports.

        Other failures may be temporary: the lease is long enough for another attempt.
        """
        while True:
            await asyncio.sleep(self.lease_s / RENEWALS_PER_LEASE)
            try:
                await self.renew()
            except NotFound:
                return
            except WayfarerError:
                continue

    # lifetime

    async def renew(self) -> float:
        """Restarts the lease; returns when it ends (Unix seconds, server's clock)."""
        request = session_pb2.RenewSessionRequest(session_id=self.session_id)
        reply = await self._connection.call(self._connection.sessions.RenewSession, request)
        return float(reply.expires_at_us / 1e6)

    async def delete(self) -> None:
        """Ends the session, its agents and its streams."""
        request = session_pb2.DeleteSessionRequest(session_id=self.session_id)
        await self._connection.call(self._connection.sessions.DeleteSession, request)

    async def export(self) -> bytes:
        """Its state, for `Client.import_session`. The session remains until it is deleted."""
        request = snapshot_pb2.ExportSessionRequest(session_id=self.session_id)
        reply = await self._connection.call(self._connection.snapshots.ExportSession, request)
        return bytes(reply.snapshot)

    async def export_log(self) -> bytes:
        """The commands of a session made with `record`, for `Client.replay`."""
        request = snapshot_pb2.ExportLogRequest(session_id=self.session_id)
        reply = await self._connection.call(self._connection.snapshots.ExportLog, request)
        return bytes(reply.log)

    async def export_motion(self, seconds: float = 0.0, file: MotionFile | None = None) -> bytes:
        """The motion of the next seconds as the content of a file, with the scene.

        0 seconds: all that a session made with `record` has recorded. No file: a GLB of all agents.
        Raises FailedPrecondition, InvalidArgument.
        """
        request = snapshot_pb2.ExportMotionRequest(
            session_id=self.session_id, file=(file or MotionFile()).to_wire(), seconds=seconds
        )
        return await self._connection.file(self._connection.snapshots.ExportMotion, request)

    async def show(self, url: str = "") -> str:
        """Shows it in the viewer; returns the address. In a notebook the viewer is a frame.

        Elsewhere it opens in a browser; without one the address is printed. `url`: where the
        server's HTTP port is seen from here; empty: port 8080 of the host that this client calls.
        The viewer shows sessions in the basis gltf.
        """
        address = page_of(
            self._connection.homes, self.session_id, url, self._connection.tls is not None
        )
        show(address)
        return address

    # agents

    async def create_agents(self, *specs: AgentSpec) -> list[Agent]:
        """Create agents, all or none. ResourceExhausted.retry_after says when there may be room."""
        request = agent_pb2.CreateAgentsRequest(
            session_id=self.session_id, agents=[spec.to_wire() for spec in specs]
        )
        reply = await self._connection.create(self._connection.agents.CreateAgents, request)
        return [agent_from_wire(agent) for agent in reply.agents]

    async def agents(self) -> list[Agent]:
        """All agents of the session as they are now."""
        request = agent_pb2.ListAgentsRequest(session_id=self.session_id)
        reply = await self._connection.call(self._connection.agents.ListAgents, request)
        return [agent_from_wire(agent) for agent in reply.agents]

    async def agent(self, agent: Agent | str) -> Agent:
        """One agent as it is now."""
        request = agent_pb2.GetAgentRequest(agent_id=id_of(agent))
        reply = await self._connection.call(self._connection.agents.GetAgent, request)
        return agent_from_wire(reply.agent)

    async def update_agent(
        self, agent: Agent | str, name: str | None = None, foot_lock: bool | None = None
    ) -> Agent:
        """Changes the given fields; returns the changed agent."""
        request = agent_pb2.UpdateAgentRequest(
            agent_id=id_of(agent), name=name, foot_lock=foot_lock
        )
        reply = await self._connection.call(self._connection.agents.UpdateAgent, request)
        return agent_from_wire(reply.agent)

    async def delete_agent(self, agent: Agent | str) -> None:
        """Removes an agent."""
        request = agent_pb2.DeleteAgentRequest(agent_id=id_of(agent))
        await self._connection.call(self._connection.agents.DeleteAgent, request)

    async def _give(self, request: Message) -> int:
        method = type(request).__name__.removesuffix("Request")
        reply = await self._connection.call(getattr(self._connection.goals, method), request)
        return int(reply.revision)

    # a crowd

    async def populate(
        self,
        count: int,
        *,
        seed: int | None = None,
        speed: tuple[float, float] | None = None,
        dwell: tuple[float, float] | None = None,
        spawn_rate: float = 0.0,
        stay: float = 0.0,
    ) -> CrowdCame:
        """Populates the session's scene with `count` walking people; returns how many have come.

        Returns once all are there, or the reason why the rest must wait is known. They replace
        the people of an earlier call; 0 removes all. `speed`: of the slowest and the fastest;
        `dwell`: least and most seconds to stand at each place; `spawn_rate`: people per second,
        0: all at once; `stay`: mean seconds until a person is replaced, 0: unlimited.
        """
        slowest, fastest = speed or (None, None)
        shortest, longest = dwell or (None, None)
        request = scene_pb2.PopulateSessionRequest(
            session_id=self.session_id,
            count=count,
            seed=seed,
            min_speed=slowest,
            max_speed=fastest,
            min_dwell=shortest,
            max_dwell=longest,
            spawn_rate=spawn_rate,
            stay=stay,
        )
        reply = await self._connection.call(self._connection.scenes.PopulateSession, request)
        return CrowdCame(reply.came, reply.waiting, reply.reason)

    # motion

    def stream(
        self,
        agents: Iterable[Agent | str] = (),
        deadline: float = 30.0,
        format: PoseFormat | None = None,
        slow_reader: str = "drop_oldest",
        resume_token: str = "",
        interest: Interest | None = None,
        max_message_bytes: int = 0,
    ) -> MotionStream:
        """Follows the agents named, or all of the session. `deadline`: see MotionStream.

        `slow_reader`: "drop_oldest"; "hold": agents wait for this reader; "disconnect": the stream
        is cut, and resumes. `interest`: detail by distance; use `control` to move the viewpoints.
        `max_message_bytes`: longer batches are split; 0: no limit.
        """
        bound = interest, max_message_bytes
        request = self._request(agents, format, slow_reader, resume_token, *bound)
        return MotionStream(self._connection, request, deadline)

    def control(
        self,
        agents: Iterable[Agent | str] = (),
        deadline: float = 30.0,
        format: PoseFormat | None = None,
        slow_reader: str = "drop_oldest",
        resume_token: str = "",
        interest: Interest | None = None,
        max_message_bytes: int = 0,
    ) -> Control:
        """Goals and motion over one connection, as `async with`; arguments as for `stream`."""
        bound = interest, max_message_bytes
        request = self._request(agents, format, slow_reader, resume_token, *bound)
        return Control(self._connection, request, deadline)

    async def step(self, steps: int = 1, format: PoseFormat | None = None) -> list[Batch]:
        """Advances a session made with `lock_step` by `steps` primitives of 0.2 s."""
        wanted = format or PoseFormat()
        layout = PoseLayout.of(wanted, await self._connection.skeleton())
        request = motion_pb2.StepAgentsRequest(
            session_id=self.session_id, steps=steps, format=wanted.to_wire()
        )
        reply = await self._connection.call(
            self._connection.motion.StepAgents, request, STEP_TIMEOUT_S
        )
        reader = BatchReader(layout)
        reader.agents = self._known
        batches = [reader.batch(batch) for batch in reply.batches]
        if reply.events:
            batches.append(Batch(0.0, (), events=tuple(map(reader.event, reply.events))))
        return batches

    def _request(
        self,
        agents: Iterable[Agent | str],
        format: PoseFormat | None,
        slow_reader: str,
        resume_token: str,
        interest: Interest | None,
        max_message_bytes: int,
    ) -> motion_pb2.StreamMotionRequest:
        return motion_pb2.StreamMotionRequest(
            session_id=self.session_id,
            agent_ids=[id_of(agent) for agent in agents],
            format=(format or PoseFormat()).to_wire(),
            slow_reader=enum_label(motion_pb2.SlowReader, slow_reader, "slow_reader"),
            resume_token=resume_token,
            interest=interest.to_wire() if interest else None,
            max_message_bytes=max_message_bytes,
        )
