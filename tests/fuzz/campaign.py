"""A whole run: inputs on all surfaces at once, during a healthy stream."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import grpc
import httpx

from tests.fuzz import grpc_calls, http_calls, sockets
from tests.fuzz.inputs import Inputs
from tests.fuzz.tally import Quota
from tests.fuzz.tally import Tally as Answers
from wayfarer.v1 import (
    agent_pb2,
    agent_pb2_grpc,
    scene_pb2,
    scene_pb2_grpc,
    session_pb2,
    session_pb2_grpc,
)
from wayfarer_lab.load.client import SimulatedClient
from wayfarer_lab.load.plan import LoadPlan
from wayfarer_lab.load.tally import Tally as StreamTally
from wayfarer_lab.load.target import Target

SETTINGS = {
    "WAYFARER_LIMITS__CALLS_PER_SECOND": "1000000",
    "WAYFARER_LIMITS__SESSIONS_PER_CALLER": "64",
    "WAYFARER_LIMITS__SCENES_PER_CALLER": "64",
    "WAYFARER_CANDIDATES": "1",
    "WAYFARER_ADMISSION": "false",
    "WAYFARER_THREADS": "1",
    "WAYFARER_LIMITS__CLIP_S": "2",
    "WAYFARER_LIMITS__STEPS_PER_CALL": "5",
}
"""Settings of the server: with the usual ones, most inputs would end at the limit of calls, and the
others would keep it busy with walking."""

MESSAGE_BYTES = 1 << 20

SHARES = {"grpc": 0.6, "socket": 0.2, "http": 0.185, "grpc_port": 0.01, "http_port": 0.005}
"""Shares of the inputs."""

WORKERS = {"grpc": 4, "socket": 2, "http": 2, "grpc_port": 1, "http_port": 2}

TEND_SECONDS = 1.0
WARM_UP = 0.2
"""Share of the inputs after which memory is first measured; each route has been used before."""


@dataclass
class Report:
    """Results of a run."""

    answers: Answers = field(default_factory=Answers)
    stream: StreamTally = field(default_factory=StreamTally)  # the healthy stream
    late_chunks: int = 0  # that left the server late
    resets: int = 0
    failed_turns: int = 0  # of the motion thread
    seconds: float = 0.0
    megabytes: list[float] = field(default_factory=list)  # after the warm-up, …, at the end

    @property
    def growth_megabytes(self) -> float:
        """Memory at the end beyond that after the warm-up."""
        return self.megabytes[-1] - self.megabytes[0] if self.megabytes else 0.0


async def run(
    target: Target,
    inputs: int,
    seed: int,
    healthy_agents: int = 4,
    progress: Callable[[Report], None] = lambda _: None,
) -> Report:
    """Sends `inputs` inputs. The same seed draws the same ones; answers may change their order.

    `progress` receives the report every second.
    """
    report = Report()
    drawn = Inputs(seed, MESSAGE_BYTES)
    async with (
        httpx.AsyncClient(base_url=target.http, timeout=20) as http,
        grpc.aio.insecure_channel(target.grpc) as channel,
        _healthy(target, report.stream, healthy_agents) as healthy,
    ):
        before, began = await _stats(http), time.monotonic()
        await _furnish(channel, drawn)
        await http_calls.use_everything(http, drawn.known, report.answers)
        async with _tended(channel, drawn, healthy, lambda: progress(report)):
            for share in (WARM_UP, 1 - WARM_UP):
                await _send(target, http, channel, drawn, report.answers, round(share * inputs))
                await _clean(channel, healthy)
                if megabytes := target.resident_megabytes():
                    report.megabytes.append(megabytes)
            after = await _stats(http)
        report.seconds = time.monotonic() - began
        report.late_chunks = after["late_chunks"] - before["late_chunks"]
        report.resets = after["resets"] - before["resets"]
        report.failed_turns = after["failures"] - before["failures"]
    return report


async def _send(
    target: Target,
    http: httpx.AsyncClient,
    channel: grpc.aio.Channel,
    inputs: Inputs,
    answers: Answers,
    count: int,
) -> None:
    quotas = {name: Quota(round(share * count)) for name, share in SHARES.items()}
    work = {
        "grpc": lambda quota: grpc_calls.worker(channel, inputs, quota, answers),
        "socket": lambda quota: sockets.worker(target.http, inputs, quota, answers),
        "http": lambda quota: http_calls.worker(http, inputs, quota, answers),
        "grpc_port": lambda quota: grpc_calls.port_worker(target.grpc, inputs, quota, answers),
        "http_port": lambda quota: http_calls.port_worker(target.http, inputs, quota, answers),
    }
    async with asyncio.TaskGroup() as tasks:
        for name, workers in WORKERS.items():
            for _ in range(workers):
                tasks.create_task(work[name](quotas[name]))


@asynccontextmanager
async def _healthy(target: Target, tally: StreamTally, agents: int) -> AsyncIterator[str]:
    """Runs a client that does everything right; yields its session."""
    plan = LoadPlan(sessions=1, agents=agents, goal_rate=0.2)
    client = SimulatedClient(target, plan, tally, 0)
    await client.open()
    assert tally.agents == agents, f"only {tally.agents} of {agents} healthy agents fit"
    walking = asyncio.create_task(client.run(time.time() + 1.0, time.time() + 1e6))
    try:
        yield client.session_id
    finally:
        assert not walking.done(), f"the healthy stream has ended: {walking}"
        walking.cancel()
        await asyncio.wait({walking})
        await client.close()


@asynccontextmanager
async def _tended(
    channel: grpc.aio.Channel, inputs: Inputs, healthy: str, tell: Callable[[], None]
) -> AsyncIterator[None]:
    """Keeps sessions alive that inputs can name, and deletes what inputs create."""

    async def tend() -> None:
        while True:
            try:
                await _clean(channel, healthy)
                await _furnish(channel, inputs)
            except grpc.aio.AioRpcError as error:
                # the machine gives the server no time, or inputs take all room for scenes for
                # a moment, or delete a scene that was just made; such answers to inputs count, too
                if error.code() not in (
                    grpc.StatusCode.NOT_FOUND,
                    grpc.StatusCode.UNAVAILABLE,
                    grpc.StatusCode.RESOURCE_EXHAUSTED,
                ):
                    raise
            tell()
            await asyncio.sleep(TEND_SECONDS)

    tending = asyncio.create_task(tend())
    try:
        yield
    finally:
        assert not tending.done(), tending
        tending.cancel()
        await asyncio.wait({tending})


async def _clean(channel: grpc.aio.Channel, healthy: str) -> None:
    sessions = session_pb2_grpc.SessionServiceStub(channel)
    page = await sessions.ListSessions(session_pb2.ListSessionsRequest())
    for session in page.sessions:
        if session.session_id != healthy:
            try:
                await sessions.DeleteSession(
                    session_pb2.DeleteSessionRequest(session_id=session.session_id)
                )
            except grpc.aio.AioRpcError as error:  # an input may have been quicker
                if error.code() is not grpc.StatusCode.NOT_FOUND:
                    raise
    scenes = scene_pb2_grpc.SceneServiceStub(channel)
    for scene in (await scenes.ListScenes(scene_pb2.ListScenesRequest())).scenes:
        try:
            await scenes.DeleteScene(scene_pb2.DeleteSceneRequest(scene_id=scene.scene_id))
        except grpc.aio.AioRpcError as error:  # gone, or an input has made a session in it
            if error.code() not in (
                grpc.StatusCode.NOT_FOUND,
                grpc.StatusCode.FAILED_PRECONDITION,
            ):
                raise


async def _furnish(channel: grpc.aio.Channel, inputs: Inputs) -> None:
    sessions = session_pb2_grpc.SessionServiceStub(channel)
    agents = agent_pb2_grpc.AgentServiceStub(channel)
    scene_id = await _scene(channel)
    requests = (
        session_pb2.CreateSessionRequest(record=True),
        session_pb2.CreateSessionRequest(scene=scene_id, lock_step=True),
        session_pb2.CreateSessionRequest(lock_step=True),
    )
    made = [(await sessions.CreateSession(request)).session.session_id for request in requests]
    names: list[str] = []
    for session_id in made:
        try:
            people = await agents.CreateAgents(
                agent_pb2.CreateAgentsRequest(
                    session_id=session_id,
                    agents=[agent_pb2.AgentSpec(gender=agent_pb2.GENDER_FEMALE)] * 2,
                )
            )
        except grpc.aio.AioRpcError as error:  # deleted by an input, or no room is left
            if error.code() not in (
                grpc.StatusCode.NOT_FOUND,
                grpc.StatusCode.RESOURCE_EXHAUSTED,
            ):
                raise
        else:
            names += [agent.agent_id for agent in people.agents]
    inputs.known.update(
        session_id=made,
        agent_id=names,
        agent_ids=names,
        scene_id=[scene_id],
        scene=[scene_id],
        name=["gamma-anny52", "corridor", "door south 1"],
        body=["anny52"],
        gender=["female", "male"],
        model=["none"],
    )


async def _scene(channel: grpc.aio.Channel) -> str:
    """Makes a scene; a new one has none of the inputs' obstacles."""
    scenes = scene_pb2_grpc.SceneServiceStub(channel)
    request = scene_pb2.CreateExampleSceneRequest(name="corridor")
    return str((await scenes.CreateExampleScene(request)).scene.scene_id)


async def _stats(http: httpx.AsyncClient) -> dict:
    answer = await http.get("/v1/stats")
    answer.raise_for_status()
    return answer.json()
