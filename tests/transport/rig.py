"""Both servers over the fake service, on free ports, and clients of them."""

import grpc
import httpx
import websockets
from grpc_health.v1 import health_pb2_grpc

from tests.transport.fakes import FakeService, gateway
from tests.transport.samples import NOW
from tests.world.fakes import ManualClock
from wayfarer.config.limits import Limits
from wayfarer.transport.server import Server
from wayfarer.v1 import (
    admin_pb2_grpc,
    agent_pb2_grpc,
    catalog_pb2_grpc,
    control_pb2_grpc,
    goal_pb2_grpc,
    motion_pb2,
    motion_pb2_grpc,
    scene_pb2_grpc,
    session_pb2_grpc,
    snapshot_pb2_grpc,
)

LIMITS = Limits(message_bytes=8192, mesh_bytes=32_768, streams_per_session=2)


class Rig:
    """A running server and clients of it."""

    def __init__(self) -> None:
        self.service = FakeService()
        self.clock = ManualClock(NOW)
        self.gateway = gateway(self.service, LIMITS, self.clock)
        self.server = Server(self.gateway, "127.0.0.1", 0, 0)

    async def __aenter__(self) -> "Rig":
        await self.server.start()
        await self.server.until_ready()
        # there is no TLS: certificates are not loaded, which takes 0.02 s
        self.http = httpx.AsyncClient(base_url=self.server.http_url, timeout=10, verify=False)
        self.channel = grpc.aio.insecure_channel(self.server.grpc_address)
        self.scenes = scene_pb2_grpc.SceneServiceStub(self.channel)
        self.sessions = session_pb2_grpc.SessionServiceStub(self.channel)
        self.agents = agent_pb2_grpc.AgentServiceStub(self.channel)
        self.goals = goal_pb2_grpc.GoalServiceStub(self.channel)
        self.motion = motion_pb2_grpc.MotionServiceStub(self.channel)
        self.catalog = catalog_pb2_grpc.CatalogServiceStub(self.channel)
        self.control = control_pb2_grpc.ControlServiceStub(self.channel)
        self.snapshots = snapshot_pb2_grpc.SnapshotServiceStub(self.channel)
        self.admin = admin_pb2_grpc.AdminServiceStub(self.channel)
        self.health = health_pb2_grpc.HealthStub(self.channel)
        self.stopped = False
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.http.aclose()
        await self.channel.close()
        if not self.stopped:
            await self.server.stop()

    async def stop(self) -> None:
        self.stopped = True
        await self.server.stop()

    async def session(self, basis: str = "gltf", agents: int = 2) -> tuple[str, list[dict]]:
        answer = await self.http.post("/v1/sessions", json={"basis": basis})
        session_id = answer.json()["session_id"]
        specs = [{"seed": i} for i in range(agents)]
        made = await self.http.post(f"/v1/sessions/{session_id}/agents", json={"agents": specs})
        assert made.status_code == 201, made.text
        return session_id, made.json()["agents"]

    def socket(self, session_id: str, query: str = "", **options: object) -> websockets.connect:
        return websockets.connect(f"{self.ws_url}/v1/stream?session={session_id}{query}", **options)

    def control_socket(self) -> websockets.connect:
        return websockets.connect(f"{self.ws_url}/v1/control")

    @property
    def ws_url(self) -> str:
        return self.server.http_url.replace("http", "ws")


async def others_are_undisturbed(rig, session_id):
    call = rig.motion.StreamMotion(motion_pb2.StreamMotionRequest(session_id=session_id))
    await call.read()
    rig.service.emit(session_id)
    assert len((await call.read()).batch.chunks.aliases) == 2
    call.cancel()
