"""Three nodes on Ray: what clients see of a cluster."""

import asyncio
import contextlib
import os
import shutil
import time
from pathlib import Path
from uuid import uuid4

import grpc
import httpx
import numpy as np
import pytest
import pytest_asyncio
import websockets

from tests.cluster.local import HAS_STORE, LEASE_S, LocalCluster, lives
from tests.cluster.watchers import Stepped, Watcher, go_on
from tests.programs import run_program
from tests.serving import needs_ray
from wayfarer.spec import STEP_SECONDS
from wayfarer.v1 import motion_pb2, motion_pb2_grpc
from wayfarer_client import AgentSpec, Box, Client, Flag, Floor, NotFound, Unavailable

STANDING = int(os.environ.get("WAYFARER_TEST_STANDING", "1"))
"""People of each of the 51 sessions that nobody watches: 12 makes 625 people with those that walk,
for which CI's two cores would take as long as for half of all other tests.
"""

LONG = int(LEASE_S / STEP_SECONDS) + 5
"""Chunks that take longer than a lease."""

pytestmark = [pytest.mark.slow, needs_ray, pytest.mark.asyncio(loop_scope="module")]


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def cluster():
    async with LocalCluster(store=HAS_STORE) as made:
        yield made


async def test_people_live_on_whatever_happens_to_a_node(cluster, record_testsuite_property):
    async with Client(cluster.entry.grpc_address) as client:
        corners = [(-3, 0, -3), (3, 0, -3), (3, 0, 310), (-3, 0, 310)]
        field = await client.scenes.create([Floor(corners)])
        version = field.message.version
        stepped = await Stepped.of(client, field.scene_id)
        crowd = await client.create_session(lease=900, scene=field.scene_id)
        await crowd.populate(3, seed=1, stay=2.0)
        idle = await asyncio.gather(*(client.create_session(lease=900) for _ in range(51)))
        people = [AgentSpec()] * STANDING
        await asyncio.gather(*(one.create_agents(*people) for one in idle))
        watched = [await Watcher.of(client) for _ in range(5)]
        watched.append(await Watcher.of(client, field.scene_id))
        everybody = [*idle, crowd, *stepped.twins, *(one.session for one in watched)]
        # those in lock-step are no load in real time
        status = await cluster.until(lambda s: sum(n.load.sessions for n in s.nodes) == 58)
        counts = [node.load.sessions for node in status.nodes]
        assert all(16 <= count <= 24 for count in counts), counts
        await go_on(watched)
        await asyncio.to_thread(javascript_follows, cluster.entry.http_url)

        async def put():
            nonlocal version
            crate = Box(position=(-2, 0, 100 + version), size=(0.5, 0.5, 0.5))
            version += 1
            assert await field.put("crate", crate) == version, "a change was lost, or made twice"

        async def all_go_on():
            assert min(await asyncio.gather(*(one.renew() for one in everybody))) > 0
            there = await asyncio.gather(*(one.agents() for one in idle))
            assert {len(agents) for agents in there} == {STANDING}
            await stepped.goes_on()
            await put()

        async def change():
            """Makes every kind of change at the scene; returns a check that nothing is lost."""
            made = [await client.create_session(lease=900, scene=field.scene_id) for _ in "123"]
            requested = [(path, str(uuid4())) for path in CREATES]
            replies = [await created(*one, field.scene_id, cluster.entry) for one in requested]
            kept, empty, gone = made
            stays, goes = await kept.create_agents(AgentSpec(name="stays"), AgentSpec())
            await gone.delete()
            await kept.delete_agent(goes)
            await put()

            async def check():
                async with asyncio.timeout(10):
                    while True:  # calls fail until the session has come
                        with contextlib.suppress(Unavailable):
                            (there,) = await kept.agents()
                            assert await empty.agents() == []
                            break
                        await asyncio.sleep(0.1)
                assert (there.agent_id, there.name) == (stays.agent_id, "stays")
                with pytest.raises(NotFound):
                    await client.session(gone.session_id)
                for one, reply in zip(requested, replies, strict=True):
                    assert await created(*one, field.scene_id, cluster.entry) == reply, one
                await put()  # with the version after the last one
                await asyncio.gather(kept.delete(), empty.delete())

            return check

        async def settle():
            """All sessions continue, on three nodes, and the neighbour of the scene's present node
            has it.
            """
            await all_go_on()
            await cluster.until(lambda s: cluster.ready(s) == 3)
            name, ends_at = await with_the_scene(cluster, watched), time.monotonic() + 120
            while time.monotonic() < ends_at:
                copied = [(line["timestamp"], line["node"], line["to"]) for line in cluster.said()
                          if (line.get("event"), line.get("scene_id"))
                          == ("scene copied", field.scene_id)]  # fmt: skip
                if name == max(copied, default=("", "", ""))[1]:
                    return
                await asyncio.sleep(0.2)
            pytest.fail(f"the scene of {name} has not been copied to its neighbour: {copied}")

        await settle()
        there = await ids(crowd)
        await kill(cluster, watched, change, record_testsuite_property)
        async with asyncio.timeout(60):
            while await ids(crowd) <= there:
                await asyncio.sleep(0.1)  # it continues: others still come
        await settle()
        await stop_for_long(cluster, watched, change)
        await settle()
        if HAS_STORE:
            await the_head_returns(cluster, watched, client)
        await the_directory_returns(cluster, watched, client)
        await all_go_on()
        await drain(cluster, watched, record_testsuite_property)
        await all_go_on()
        await restart_entry(cluster, watched)
        for one in watched:
            await one.close()


CREATES = ("/v1/sessions", "/v1/sessions?inside", "/v1/scenes/examples/corridor")


async def created(path, key, scene, entry):
    """The id of what a request with this key makes, or has made."""
    path, _, inside = path.partition("?")
    body, headers = (
        {"lease_s": 900} | ({"scene": scene} if inside else {}),
        {"Idempotency-Key": key},
    )
    async with httpx.AsyncClient(timeout=30) as http:
        answer = await http.post(entry.http_url + path, json=body, headers=headers)
        while answer.status_code == 421:
            there = answer.json()["endpoint"]
            url = f"http://{there['host']}:{there['http_port']}{path}"
            answer = await http.post(url, json=body, headers=headers)
    told = answer.raise_for_status().json()
    return told.get("session_id") or told["scene_id"]


JAVASCRIPT = """
import { Api } from "%s/clients/web/src/index.js";
const api = new Api(process.argv[1]);
const { session_id: id } = await api.createSession(60);
const agents = await api.createAgents(id, [{}]);
if (agents.length !== 1 || api.homeOf(id) === process.argv[1]) throw new Error(api.homeOf(id));
const other = new Api(process.argv[1]);
if ((await other.session(id)).session_id !== id) throw new Error("not found through the entry");
api.abandonSession(id);
"""


def javascript_follows(url):
    """As the Python client does, above."""
    if shutil.which("node") is None:
        return
    code = JAVASCRIPT % Path(__file__).parents[2]
    run_program("node", "--input-type=module", "--eval", code, url)


async def ids(session):
    return {agent.agent_id for agent in await session.agents()}


def living_on(cluster, name, watched):
    """The watched sessions of this node."""
    return [one for one in watched if cluster.owner(one.session) == name]


async def with_the_scene(cluster, watched):
    """Name of the node that has the last of the watched, in a scene with those in lock-step."""
    await asyncio.sleep(0.5)  # the entry's view
    return cluster.owner(watched[-1].session)


async def kill(cluster, watched, change, record_testsuite_property):
    name = await with_the_scene(cluster, watched)
    there = living_on(cluster, name, watched)
    await asyncio.sleep(1.5)  # all have been copied to the neighbour since they began to walk
    for one in watched:
        one.clear()
    victim = await cluster.process(name)
    check = await change()
    killed_at = time.monotonic()
    victim.kill()
    await go_on(watched, 10)
    await check()
    for one in there:
        assert "gap" in one.events, "it is said that something was lost"
        assert any(flag & Flag.FIRST for flag in one.flags)
        steps = np.linalg.norm(np.diff(one.places, axis=0), axis=1)
        assert steps.max() < 4.0, "an agent that walks on begins where it was a second or two ago"
    for one in watched:
        if one not in there:
            assert not one.events, "others do not notice"
    worst = max(np.diff([killed_at, *one.heard_at]).max() for one in there)
    record_testsuite_property("seconds_without_motion_after_a_kill", round(worst, 2))


async def stop_for_long(cluster, watched, change):
    """Its process is stopped: what clients hear from it ends, whichever they are."""
    name = await with_the_scene(cluster, watched)
    there = living_on(cluster, name, watched)
    process = await cluster.process(name)
    assert there
    node = next(n.node for n in (await cluster.status()).nodes if n.node.name == name)
    before = {one: one.stream.reconnections for one in there}
    check = await change()
    async with contextlib.AsyncExitStack() as streams:
        heard = [await streams.enter_async_context(kind(node, there[0].session)) for kind in KINDS]
        for one in watched:
            one.clear()
        process.suspend()
        async with asyncio.timeout(3):
            await asyncio.gather(*(until_it_ends(one) for one in heard))
    async with asyncio.timeout(3):
        while any(one.stream.reconnections == count for one, count in before.items()):
            await asyncio.sleep(0.05)
    await go_on(watched, 10)
    assert not lives(process)
    await check()


@contextlib.asynccontextmanager
async def over_grpc(node, session):
    request = motion_pb2.StreamMotionRequest(session_id=session.session_id)
    async with grpc.aio.insecure_channel(f"127.0.0.1:{node.grpc_port}") as channel:
        yield motion_pb2_grpc.MotionServiceStub(channel).StreamMotion(request)


@contextlib.asynccontextmanager
async def over_websocket(node, session):
    where = f"ws://127.0.0.1:{node.http_port}/v1/stream?session={session.session_id}"
    async with websockets.connect(where, ping_interval=None) as socket:
        yield socket


@contextlib.asynccontextmanager
async def server_sent(node, session):
    async with (
        httpx.AsyncClient(base_url=f"http://127.0.0.1:{node.http_port}", timeout=None) as http,
        http.stream("GET", "/v1/events", params={"session": session.session_id}) as answer,
    ):
        yield answer.aiter_bytes()


@contextlib.asynccontextmanager
async def lines(node, session):
    """A clip of two minutes as NDJSON."""
    clip = {"goals": [{"position": {"x": 0, "y": 0, "z": 300}}], "seconds": 120}
    async with (
        httpx.AsyncClient(base_url=f"http://127.0.0.1:{node.http_port}", timeout=None) as http,
        http.stream("POST", "/v1/clips", json=clip) as answer,
    ):
        yield answer.aiter_lines()


KINDS = (over_grpc, over_websocket, server_sent, lines)
"""Streams of clients that trust a connection for as long as it stands."""

ENDED = (grpc.aio.AioRpcError, websockets.ConnectionClosed, httpx.TransportError)


async def until_it_ends(stream):
    with contextlib.suppress(*ENDED):
        async for _ in stream:
            pass


async def the_head_returns(cluster, watched, client):
    """Ray's head is killed, and started again with the state that it had: nobody notices."""
    for one in watched:
        one.clear()
    cluster.kill_head()
    assert not await asyncio.to_thread(cluster.head_answers)
    await go_on(watched, LONG)
    await (await client.create_session()).delete()
    cluster.start_head()
    await go_on(watched)
    for one in watched:
        assert one.events == [] and set(np.diff(one.seqs)) == {1}
    assert await asyncio.to_thread(cluster.head_answers)


async def the_directory_returns(cluster, watched, client):
    """Ray starts it again, and the nodes tell it what they hold."""
    for one in watched:
        one.clear()
    generation = (await cluster.status()).generation
    cluster.kill("DirectoryActor")
    await cluster.until(lambda status: status.generation != generation and status.settled)
    async with asyncio.timeout(10):
        while not cluster.entry.finder.ready:
            await asyncio.sleep(0.05)
    await (await client.create_session()).delete()
    await go_on(watched, LONG)
    for one in watched:
        assert one.events == [] and set(np.diff(one.seqs)) == {1}, "nobody had to be adopted"


async def drain(cluster, watched, record_testsuite_property):
    name = await with_the_scene(cluster, watched)
    there = living_on(cluster, name, watched)
    assert there
    for one in watched:
        one.clear()
    async with httpx.AsyncClient(base_url=cluster.entry.http_url) as http:
        answer = await http.post(f"/v1/cluster/nodes/{name}/drain")
        assert answer.status_code == 202, answer.text
    await cluster.until(lambda status: name not in [one.node.name for one in status.nodes])
    await go_on(watched, 10)
    for one in watched:
        assert one.events == [], one.details  # nothing was lost
        assert set(np.diff(one.seqs)) == {1}, "every primitive came, and once"
    worst = max(np.diff(one.heard_at).max() for one in there)
    record_testsuite_property("longest_wait_of_a_stream_during_a_drain_s", round(worst, 3))


async def restart_entry(cluster, watched):
    port = int(cluster.entry.grpc_address.rpartition(":")[2])
    for one in watched:
        one.clear()
    await cluster.entry.stop()
    await go_on(watched)
    settings = cluster.settings.model_copy(update={"grpc_port": port})
    cluster.entry = cluster.new_entry(settings)
    await cluster.entry.start()
    await go_on(watched)
    for one in watched:
        assert not one.events
        assert set(np.diff(one.seqs)) == {1}
    async with Client(cluster.entry.grpc_address) as client:
        joined = await client.session(watched[0].session.session_id)
        assert len(await joined.agents()) == 1
