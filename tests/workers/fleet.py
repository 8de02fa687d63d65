"""Two workers over fake services and a front before them, all in this process."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import grpc
import httpx

from tests.transport.fakes import FakeService
from tests.transport.rig import LIMITS
from wayfarer.config import Settings
from wayfarer.endpoint import Endpoint
from wayfarer.ids import agent_id, scene_id, session_id
from wayfarer.transport.auth import Authenticator, Credentials
from wayfarer.transport.auth.keys import KeyFile
from wayfarer.transport.bodies import BodyLibrary
from wayfarer.transport.caller import LOCAL, Caller
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.guard import Guard
from wayfarer.transport.server import Server
from wayfarer.transport.server_options import ServerOptions
from wayfarer.transport.worker_sockets import WorkerSockets
from wayfarer.workers.assignments import _ports
from wayfarer.workers.front import Front
from wayfarer.workers.messages import DOWN, Report
from wayfarer.workers.placement import Placement
from wayfarer.workers.shares import WorkerShares
from wayfarer.world.agents.agent import AgentInfo, AgentSpec, SessionInfo, SessionSpec


class ShardedService(FakeService):
    """Its ids say where they live."""

    def __init__(self, shares: WorkerShares) -> None:
        super().__init__()
        self._shares = shares

    async def create_session(self, spec: SessionSpec) -> SessionInfo:
        named = replace(spec, session_id=session_id(self._shares.new_key()))
        return await super().create_session(named)

    def new_scene_id(self) -> str:
        return scene_id(self._shares.new_key())

    async def create_agents(self, session_id: str, specs: Sequence[AgentSpec]) -> list[AgentInfo]:
        await super().create_agents(session_id, specs)
        agents = self._sessions[session_id]
        agents[-len(specs) :] = [
            replace(agent, agent_id=agent_id(session_id)) for agent in agents[-len(specs) :]
        ]
        return agents[-len(specs) :]


@dataclass(frozen=True, slots=True)
class SeeingGuard(Guard):
    """Lets everybody in, and notes who came."""

    seen: list[tuple[Credentials, str]] = field(default_factory=list)

    async def admit(self, shown: Credentials, address: str) -> Caller:
        self.seen.append((shown, address))
        return LOCAL


UP = Report(alive=True, ready=True, started=True)


@dataclass
class FakeWorker:
    """What the front sees of a worker's process."""

    index: int
    report: Report = UP
    restarts: int = 0


@dataclass
class FakeSupervisor:
    workers: list[FakeWorker]

    @property
    def ready(self) -> bool:
        return all(worker.report.ready for worker in self.workers)

    @property
    def started(self) -> bool:
        return all(worker.report.started for worker in self.workers)


class Rig:
    """A running front and its workers. `keys`: file of those that the front asks for."""

    def __init__(self, folder: Path, count: int = 2, keys: Path | None = None) -> None:
        self.folder, self.count, self.keys = folder, count, keys

    async def __aenter__(self) -> "Rig":
        settings = Settings(http_port=0, grpc_port=0, limits=LIMITS, drain_s=0.2)
        grpc_ports, http_ports = (_ports(settings, 0, self.count) for _ in range(2))
        endpoints = [
            Endpoint(worker=i, grpc_port=grpc_ports[i], http_port=http_ports[i])
            for i in range(self.count)
        ]
        self.services, self.servers, self.gateways, doors = [], [], [], []
        self.guard = SeeingGuard()
        for i, endpoint in enumerate(endpoints):
            doors.append(WorkerSockets(self.folder / str(i)))
            doors[i].folder.mkdir()
            self.services.append(ShardedService(WorkerShares(i, endpoints)))
            self.gateways.append(
                Gateway(
                    self.services[i],
                    BodyLibrary("anny52"),
                    LIMITS,
                    asyncio.get_running_loop().time,
                    lambda: None,
                    WorkerShares(i, endpoints),
                )
            )
            self.servers.append(
                Server(
                    self.gateways[i],
                    "127.0.0.1",
                    endpoint.http_port,
                    endpoint.grpc_port,
                    ServerOptions(guard=self.guard, metrics_access="open", drain_s=0.2),
                    doors[i],
                )
            )
        for server in self.servers:
            await server.start()
            await server.until_ready()
        self.workers = [FakeWorker(i) for i in range(self.count)]
        self.front = Front(
            settings,
            ServerOptions(
                Guard(Authenticator(KeyFile(self.keys))) if self.keys else Guard(), drain_s=0.2
            ),
            doors,
            Placement(self.workers, lambda: 0.0),
            FakeSupervisor(self.workers),  # type: ignore[arg-type]
        )
        await self.front.start()
        self.http = httpx.AsyncClient(base_url=self.front.http_url, timeout=20)
        self.channel = grpc.aio.insecure_channel(self.front.grpc_address)
        self.stopped: set[int] = set()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.http.aclose()
        await self.channel.close()
        for index in set(range(self.count)) - self.stopped:
            await self.stop_worker(index)
        await self.front.stop()

    async def stop_worker(self, index: int) -> None:
        self.stopped.add(index)
        await self.servers[index].stop()
        self.workers[index].report = DOWN

    @property
    def ws_url(self) -> str:
        return self.front.http_url.replace("http", "ws")

    async def session(self, agents: int = 2) -> tuple[dict, list[dict]]:
        session = (await self.http.post("/v1/sessions", json={})).json()
        specs = {"agents": [{"seed": i} for i in range(agents)]}
        made = await self.http.post(f"/v1/sessions/{session['session_id']}/agents", json=specs)
        assert made.status_code == 201, made.text
        return session, made.json()["agents"]

    def service(self, session: dict) -> ShardedService:
        return self.services[session["endpoint"]["worker"]]
